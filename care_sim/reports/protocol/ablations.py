"""The tables of the ablations in the open loop (paper, Sec. 5.4): one table per ablation."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.reports.formatting import interval
from care_sim.reports.protocol.cells import PlayCells
from care_sim.reports.protocol.closing import protocol_closing
from care_sim.reports.protocol.formatting import PAPER, claims_of_paper, rounded, written
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
from care_sim.reports.table import Table
from care_sim.study.designs.ablations import GUARD, OPEN_ABLATIONS, OPEN_POLICIES, Ablation
from care_sim.study.designs.variants import USUAL_VARIANT, FilmPlace, Variant
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL, Row


class _Measure(NamedTuple):
    name: str
    ratio: Ratio
    within: str


_MEASURES = (
    _Measure("first sightings", FIRST_SIGHTING, ""),
    _Measure("below 20 m", OVERALL, NEAR_FIELD),
    _Measure("overall", OVERALL, ""),
)
_COLUMNS = (
    "level",
    *(name for measure in _MEASURES for name in (f"{measure.name} %", "difference")),
    "released",
)
_LEVELS = tuple(name for name in _COLUMNS if name != "difference")
_READING = (
    "Differences in points of recall, with intervals over scenes, none of fewer than "
    f"{FEWEST_PAIRS}. Below 20 m: overall recall in the paper's near field. Released: cells of the "
    "forecasts' full hulls that exploitation does not ask for, mean over keyframes."
)


def ablation_tables(rows: Sequence[Row]) -> list[Table]:
    """One table per ablation: at every budget its levels less the usual one, then less each
    reference.
    """
    study = AblationPlays(rows)
    return [study.table(ablation) for ablation in OPEN_ABLATIONS]


def ablation_closing(rows: Sequence[Row]) -> list[str]:
    """Size of the study, the gate, and what the full scan finds."""
    return [*protocol_closing(rows), *AblationPlays(rows).ceiling()]


class AblationPlays:
    """The plays of the study, the budgets, and the policies that were played beside its own."""

    def __init__(self, rows: Sequence[Row]):
        self.cells = PlayCells(rows)
        self.source = rows[0]["source"]
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        played = dict.fromkeys(row["policy"] for row in rows)
        self.joined = [policy for policy in played if policy not in OPEN_POLICIES]

    def table(self, ablation: Ablation) -> Table:
        """All blocks of an ablation, and the paper's sentences on it."""
        blocks = [
            _Block(self.cells, ablation, FilmPlace(self.source, budget), base)
            for budget in self.budgets
            for base in (USUAL, *ablation.beside(self.joined))
        ]
        title = ablation.title
        known = PUBLISHED_ON_ALL_LEVELS if Setting(self.source).has_paper else {}
        together = [known[title]] if title in known else []
        said = [claims.source for block in blocks for claims in block.said()]
        return Table(
            f"{ablation.policy}: {title}",
            _COLUMNS,
            tuple(line for block in blocks for line in block.lines()),
            (_READING, *ablation.notes),
            papers([*together, *said]),
            whole=_LEVELS,
        )

    def ceiling(self) -> Iterator[str]:
        """What the full scan finds, in a sentence; nothing where it was not played."""
        key = USUAL_VARIANT.key(FilmPlace(self.source, 1.0), FULL)
        levels = [
            f"{measure.name} {written(measure.ratio, level)}%"
            for measure in _MEASURES
            if (level := self.cells.level(measure.ratio, key, measure.within)) is not None
        ]
        if levels:
            yield f"The full scan finds: {', '.join(levels)}."


@dataclass(frozen=True)
class _Block:
    """The levels of an ablation at a budget less a base: the usual level, or a policy under the
    conditions of the level.
    """

    cells: PlayCells
    ablation: Ablation
    place: FilmPlace
    base: str

    def lines(self) -> Iterator[tuple[str, ...]]:
        """A heading, the levels, and under each what the paper says of it."""
        yield (f"{percent(self.place.budget)}, minus {self._base_name()}",)
        for level in self.ablation.levels:
            yield self._line(level)
            paper = [self._of_paper(level, measure) for measure in _MEASURES]
            release = self._published_release(level)
            if any(paper) or release:
                yield (PAPER, *(entry for said in paper for entry in ("", said)), release)

    def said(self) -> Iterator[Claims]:
        """What the paper says of these levels at this budget."""
        for level in self.ablation.levels:
            for measure in _MEASURES:
                if (claims := self._claims(level, measure)) and claims.at(self.place.budget):
                    yield claims

    def _base_name(self) -> str:
        return "the usual level" if self.base == USUAL else self.base

    def _line(self, level: Variant) -> tuple[str, ...]:
        """Levels and released cells stand in the first block of a budget alone."""
        ours = level.key(self.place, self.ablation.policy)
        usual = USUAL_VARIANT.key(self.place, self.ablation.policy)
        first = self.base == USUAL
        theirs = usual if first else level.for_others().key(self.place, self.base)
        entries = []
        for _, ratio, within in _MEASURES:
            value = self.cells.level(ratio, ours, within) if first else None
            # The usual level is not compared with itself.
            change = None
            if ours != theirs:
                change = self.cells.difference(ratio, ours, theirs, within)
            entries += [written(ratio, value), interval(change)]
        released = self.cells.mean("released", ours) if first else None
        name = f"{level.label} (usual)" if ours == usual else level.label
        return (name, *entries, rounded(released))

    def _claims(self, level: Variant, measure: _Measure) -> Claims | None:
        if not Setting(self.place.source).has_paper:
            return None
        _, ratio, within = measure
        return PUBLISHED_CHANGES.get(
            LevelChange(self.ablation.title, level.label, self.base, ratio, within)
        )

    def _of_paper(self, level: Variant, measure: _Measure) -> str:
        entries = claims_of_paper(self._claims(level, measure), [self.place.budget])
        return entries[0] if entries else ""

    def _published_release(self, level: Variant) -> str:
        default = self.ablation.title == GUARD.title and not level.parameters
        if self.base != USUAL or not default or not Setting(self.place.source).has_paper:
            return ""
        return rounded(PUBLISHED_RELEASE.get(self.place.budget))
