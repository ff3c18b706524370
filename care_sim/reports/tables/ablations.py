"""The tables of the paper's ablations (Sec. 5.4), in either loop: one table per ablation."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import quartiles
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import level
from care_sim.reports.engine.measures import BRAKED, DETECTION, Measure, Recall
from care_sim.reports.engine.tables import PAPER
from care_sim.reports.formatting import interval, quarters
from care_sim.reports.protocol.formatting import claims_of_paper, rounded
from care_sim.reports.protocol.notes import papers
from care_sim.reports.protocol.paper import Claims
from care_sim.reports.protocol.paper_ablations import (
    NEAR_FIELD,
    PUBLISHED_CHANGES,
    PUBLISHED_ON_ALL_LEVELS,
    PUBLISHED_RELEASE,
    USUAL,
    LevelChange,
)
from care_sim.reports.table import Table, TableRow
from care_sim.study.designs.ablations import (
    ABLATION_PLACES,
    ABLATIONS,
    GUARD,
    OPEN_ABLATIONS,
    Ablation,
)
from care_sim.study.designs.variants import USUAL_VARIANT, FilmPlace, Place, Variant
from care_sim.study.rows.reading import Key
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL, Row

OPEN_MEASURES = {
    "first sightings": Recall(FIRST_SIGHTING),
    "below 20 m": Recall(OVERALL, NEAR_FIELD),
    "overall": Recall(OVERALL),
}
_RELEASED = (
    "Released: cells of the forecasts' full hulls that exploitation does not fire, mean over "
    "keyframes."
)


def ablation_tables(rows: Sequence[Row]) -> list[Table]:
    """One table per ablation: its levels, and these less the usual one and less each reference."""
    study = AblationStudy(rows)
    return [_table(study, ablation) for ablation in study.ablations]


def ceiling(rows: Sequence[Row]) -> list[str]:
    """What the full scan finds of the films, in a sentence; nothing where it was not played."""
    study = AblationStudy(rows)
    key = USUAL_VARIANT.key(FilmPlace(study.source, 1.0), FULL)
    units = {name: study.frame.units(measure, key) for name, measure in OPEN_MEASURES.items()}
    levels = [f"{name} {level(OPEN_MEASURES[name], own)}%" for name, own in units.items() if own]
    return [f"The full scan finds: {', '.join(levels)}."] if levels else []


class AblationStudy:
    """The rows of the study, the ablations of their loop, and where each was played."""

    def __init__(self, rows: Sequence[Row]):
        self.frame = Frame(rows)
        self.source: str = rows[0].get("source", "")
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        self.ablations = OPEN_ABLATIONS if self.source else ABLATIONS
        self.places: Sequence[Place | FilmPlace] = ABLATION_PLACES
        self.measures: dict[str, Measure | Recall] = {"first detection m": DETECTION}
        if self.source:
            self.places = [FilmPlace(self.source, budget) for budget in self.budgets]
            self.measures = {f"{name} %": each for name, each in OPEN_MEASURES.items()}
        own = {FULL} | {
            name
            for ablation in self.ablations
            for name in (
                ablation.policy,
                *ablation.references,
                *(each.policy for each in ablation.levels),
            )
        }
        self.joined = [policy for policy in self.frame.policies if policy not in own]


def _table(study: AblationStudy, ablation: Ablation) -> Table:
    beside = ablation.beside(study.joined)
    blocks = [
        _Block(study, ablation, place, name, (USUAL, *beside))
        for place in study.places
        for name in study.measures
    ]
    columns = (
        "level",
        "value",
        *(("released",) if study.source else ("quartiles m", "braked")),
        "minus usual",
        *(f"minus {study.frame.marked(policy)}" for policy in beside),
    )
    known = PUBLISHED_ON_ALL_LEVELS if Setting(study.source).has_paper else {}
    together = [known[ablation.title]] if ablation.title in known else []
    notes = [*([_RELEASED] if study.source else []), *ablation.notes]
    return Table(
        f"{ablation.policy}: {ablation.title}",
        columns,
        tuple(line for block in blocks for line in block.lines()),
        (*([" ".join(notes)] if notes else []), *study.frame.notes(beside)),
        papers([*together, *(claims.source for block in blocks for claims in block.said())]),
        files_only=() if study.source else ("quartiles m", "braked"),
        whole=columns[:4],
    )


@dataclass(frozen=True)
class _Block:
    """The levels of an ablation in a place by one measure, and these less the bases: the usual
    level, or a policy under the conditions of the level.
    """

    study: AblationStudy
    ablation: Ablation
    place: Place | FilmPlace
    name: str
    bases: Sequence[str]

    @property
    def measure(self) -> Measure | Recall:
        """What is compared."""
        return self.study.measures[self.name]

    def lines(self) -> Iterator[TableRow]:
        """A heading, the levels, and under each what the paper says of it."""
        where = percent(self.place.budget) if self.study.source else str(self.place)
        yield (f"{where}, {self.name}",)
        frame = self.study.frame
        for each in self.ablation.levels:
            ours = each.key(self.place, self.ablation.policy)
            bases = [self._key(each, base) for base in self.bases]
            yield (
                # The usual level is played once and stands in every ablation, compared with
                # nothing.
                f"{each.label} (usual)" if ours == bases[0] else each.label,
                level(self.measure, frame.units(self.measure, ours)),
                *self._beside(ours),
                *(
                    "" if ours == base else interval(frame.contrast(self.measure, ours, base))
                    for base in bases
                ),
            )
            said = [self._of_paper(each, base) for base in self.bases]
            release = self._published_release(each)
            if any(said) or release:
                yield (PAPER, "", release, *said)

    def said(self) -> Iterator[Claims]:
        """What the paper says of these levels at this budget."""
        for each in self.ablation.levels:
            for base in self.bases:
                if (claims := self._claims(each, base)) and claims.at(self.place.budget):
                    yield claims

    def _key(self, each: Variant, base: str) -> Key:
        if base == USUAL:
            return USUAL_VARIANT.key(self.place, self.ablation.policy)
        # The others feel the conditions of a level and not its parameters, which are the own ones
        # of the policy.
        return each.for_others().key(self.place, base)

    def _beside(self, key: Key) -> tuple[str, ...]:
        """What stands beside a level: in the open loop the released cells, under the first measure;
        else the quartiles, and how many episodes braked.
        """
        rows = self.study.frame.of(key)
        if not self.study.source:
            found = quartiles([*DETECTION.units(rows).values()])
            return quarters(found) if found else "", level(BRAKED, BRAKED.units(rows))
        told = [row["released"] for row in rows if row.get("released") is not None]
        first = self.name == next(iter(self.study.measures))
        complete = first and told and len(told) == len(rows)
        return (rounded(float(np.mean(told))) if complete else "",)

    def _claims(self, each: Variant, base: str) -> Claims | None:
        if not Setting(self.study.source).has_paper or not isinstance(self.measure, Recall):
            return None
        return PUBLISHED_CHANGES.get(
            LevelChange(
                self.ablation.title, each.label, base, self.measure.ratio, self.measure.within
            )
        )

    def _of_paper(self, each: Variant, base: str) -> str:
        entries = claims_of_paper(self._claims(each, base), [self.place.budget])
        return entries[0] if entries else ""

    def _published_release(self, each: Variant) -> str:
        default = self.ablation.title == GUARD.title and not each.parameters
        first = self.name == next(iter(self.study.measures))
        if not (default and first and Setting(self.study.source).has_paper):
            return ""
        return rounded(PUBLISHED_RELEASE.get(self.place.budget))
