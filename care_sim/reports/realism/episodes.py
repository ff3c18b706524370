"""Realism in the closed loop: first detections, and collisions where somebody may be hit."""

from collections.abc import Sequence

from care_sim.evaluation.censoring import quartiles
from care_sim.reports.closings import collisions
from care_sim.reports.contrasts import (
    AVOIDED,
    DETECTION,
    Contrast,
    contrast,
    contrast_of_cases,
)
from care_sim.reports.formatting import median, tag_notes
from care_sim.reports.group_rows import GroupRows
from care_sim.reports.realism.orders import Order, Standing, of_episodes
from care_sim.reports.realism.tables import tables_of, verdict_sentences
from care_sim.reports.table import Table
from care_sim.study.designs.realism import CONDITIONS, HEADLINES, IDEAL, LATE_CAMERA, Headline
from care_sim.study.designs.variants import Variant
from care_sim.study.rows.reading import detections, is_avoided
from care_sim.study.run_config import FULL, REFERENCE, Row


def realism_tables(rows: Sequence[Row]) -> list[Table]:
    """The orders of the headline tables under every condition, and every policy's figures."""
    return tables_of(RealismEpisodes(rows))


def realism_closing(rows: Sequence[Row]) -> list[str]:
    """Size of the study, and how many orders hold."""
    return [collisions(rows), *verdict_sentences(RealismEpisodes(rows))]


class RealismEpisodes(GroupRows):
    """The rows of the study by headline table."""

    title = "Closed loop"
    unit = "m or points"
    levels_told = "median first detection, m, or collisions avoided"
    cameras = (LATE_CAMERA,)

    def __init__(self, rows: Sequence[Row]):
        super().__init__(rows)
        self._policies = {
            headline.name: [
                policy
                for policy in dict.fromkeys([*headline.policies, *self.tags])
                if self.of(headline, IDEAL, policy)
            ]
            for headline in HEADLINES
        }
        # A full scan is of every table of its scenario: alone it is of one that was not played.
        self._headlines = {
            each.name: each for each in HEADLINES if {*self._policies[each.name]} - {FULL}
        }
        self.conditions = [level for level in CONDITIONS if self._is_played(level)]

    def orders(self) -> dict[str, list[Order]]:
        """The pairs of every headline table, and CARE with every policy that joined in."""
        return {
            "": [
                Order(headline.name, pair, standings)
                for headline in self._headlines.values()
                for pair in self._pairs(headline)
                if (standings := self._standings(headline, *pair))
            ]
        }

    def blocks(self) -> dict[str, list[str]]:
        """The policies of every headline table."""
        return {name: self._policies[name] for name in self._headlines}

    def level(self, block: str, condition: Variant, policy: str) -> str:
        """The median first detection, or how many episodes of all had no collision."""
        headline = self._headlines[block]
        rows = self.of(headline, condition, policy)
        if headline.by_collisions:
            return f"{sum(map(is_avoided, rows))}/{len(rows)}" if rows else ""
        return median(quartiles(detections(rows))) if rows else ""

    def change(self, block: str, condition: Variant, policy: str) -> Contrast | None:
        """What the condition adds to first detection, or to the collisions avoided."""
        headline = self._headlines[block]
        return _difference(
            headline, self.of(headline, condition, policy), self.of(headline, IDEAL, policy)
        )

    def notes(self) -> tuple[str, ...]:
        """What the marks of policies mean."""
        return tag_notes(self.tags.values())

    def _pairs(self, headline: Headline) -> list[tuple[str, str]]:
        joined = [each for each in self._policies[headline.name] if each not in headline.policies]
        return [*headline.pairs, *((REFERENCE, policy) for policy in joined)]

    def _standings(self, headline: Headline, *pair: str) -> dict[str, Standing]:
        found = {}
        for level in self.conditions:
            ours, theirs = (self.of(headline, level, policy) for policy in pair)
            if standing := of_episodes(_difference(headline, ours, theirs)):
                found[level.label] = standing
        return found

    def _is_played(self, level: Variant) -> bool:
        return any(
            self.of(headline, level, policy)
            for headline in self._headlines.values()
            for policy in headline.policies
        )


def _difference(headline: Headline, ours: Sequence[Row], theirs: Sequence[Row]) -> Contrast | None:
    differ = contrast_of_cases if len(headline.places) > 1 else contrast
    return differ(AVOIDED if headline.by_collisions else DETECTION, ours, theirs)
