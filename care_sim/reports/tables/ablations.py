"""The tables of the paper's ablations (Sec. 5.4), in either loop: one table per ablation, a column
per level.
"""

from collections.abc import Iterator, Sequence

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
    "first sightings %": Recall(FIRST_SIGHTING),
    "below 20 m %": Recall(OVERALL, NEAR_FIELD),
    "overall %": Recall(OVERALL),
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
    found = {
        name: level(each, study.frame.units(each, key)) for name, each in study.measures.items()
    }
    levels = [f"{name.removesuffix(' %')} {value}%" for name, value in found.items() if value]
    return [f"The full scan finds: {', '.join(levels)}."] if levels else []


class AblationStudy:
    """The rows of the study, the ablations and measures of their loop, and where they were
    played.
    """

    def __init__(self, rows: Sequence[Row]):
        self.frame = Frame(rows)
        self.source: str = rows[0].get("source", "")
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        self.ablations = OPEN_ABLATIONS if self.source else ABLATIONS
        self.measures: dict[str, Measure | Recall] = {"first detection m": DETECTION}
        self.places: Sequence[Place | FilmPlace] = ABLATION_PLACES
        if self.source:
            self.measures = {**OPEN_MEASURES}
            self.places = [FilmPlace(self.source, budget) for budget in self.budgets]
        own = {FULL}
        for each in self.ablations:
            own |= {each.policy, *each.references, *(one.policy or FULL for one in each.levels)}
        self.joined = [policy for policy in self.frame.policies if policy not in own]

    @property
    def has_paper(self) -> bool:
        """Whether the paper's figures stand beside those of these films."""
        return Setting(self.source).has_paper


def _table(study: AblationStudy, ablation: Ablation) -> Table:
    usual = [
        each.key(study.places[0], ablation.policy) for each in (USUAL_VARIANT, *ablation.levels)
    ]
    names = [
        f"{each.label} (usual)" if key == usual[0] else each.label
        for each, key in zip(ablation.levels, usual[1:], strict=True)
    ]
    beside = ablation.beside(study.joined)
    lines: list[TableRow] = []
    for place in study.places:
        for name in study.measures:
            where = percent(place.budget) if study.source else str(place)
            lines += [(f"{where}, {name}",), *_lines(study, ablation, place, name, beside)]
    said = [PUBLISHED_ON_ALL_LEVELS.get(ablation.title)] if study.has_paper else []
    said += [
        claims.source
        for change, claims in PUBLISHED_CHANGES.items()
        if study.has_paper and change.title == ablation.title and claims.any_at(study.budgets)
    ]
    notes = " ".join([*([_RELEASED] if study.source else []), *ablation.notes])
    return Table(
        f"{ablation.policy}: {ablation.title}",
        ("", *names),
        tuple(lines),
        (*([notes] if notes else []), *study.frame.notes(beside)),
        papers(filter(None, said)),
    )


def _lines(
    study: AblationStudy, ablation: Ablation, place: Place | FilmPlace, name: str, beside: list[str]
) -> Iterator[TableRow]:
    """The levels by one measure, and what they have over the usual level and over each reference;
    under each line what the paper says of it.
    """
    frame, measure = study.frame, study.measures[name]
    keys = [each.key(place, ablation.policy) for each in ablation.levels]
    yield (ablation.policy, *(level(measure, frame.units(measure, key)) for key in keys))
    if not study.source:
        yield ("quartiles", *(_quarters(frame.of(key)) for key in keys))
        yield ("braked", *(level(BRAKED, frame.units(BRAKED, key)) for key in keys))
    elif name == next(iter(study.measures)):
        yield ("released", *(_released(frame.of(key)) for key in keys))
        if study.has_paper and ablation.title == GUARD.title and place.budget in PUBLISHED_RELEASE:
            release = rounded(PUBLISHED_RELEASE[place.budget])
            yield (PAPER, *("" if each.parameters else release for each in ablation.levels))
    for base in (USUAL, *beside):
        bases = [_base(ablation, place, each, base) for each in ablation.levels]
        # The usual level stands in every ablation, compared with nothing.
        changes = [
            "" if ours == theirs else interval(frame.contrast(measure, ours, theirs))
            for ours, theirs in zip(keys, bases, strict=True)
        ]
        yield (f"minus {frame.marked(base)}", *changes)
        claims = [_claims(study, ablation, name, each, base) for each in ablation.levels]
        told = [claims_of_paper(each, [place.budget]) for each in claims]
        if any(told):
            yield (PAPER, *(entry[0] if entry else "" for entry in told))


def _base(ablation: Ablation, place: Place | FilmPlace, each: Variant, base: str) -> Key:
    if base == USUAL:
        return USUAL_VARIANT.key(place, ablation.policy)
    # The others feel the conditions of a level and not its parameters, which are the own ones of
    # the policy.
    return each.for_others().key(place, base)


def _claims(
    study: AblationStudy, ablation: Ablation, name: str, each: Variant, base: str
) -> Claims | None:
    measure = study.measures[name]
    if not study.has_paper or not isinstance(measure, Recall):
        return None
    change = LevelChange(ablation.title, each.label, base, measure.ratio, measure.within)
    return PUBLISHED_CHANGES.get(change)


def _quarters(rows: Sequence[Row]) -> str:
    found = quartiles([*DETECTION.units(rows).values()])
    return quarters(found) if found else ""


def _released(rows: Sequence[Row]) -> str:
    """The mean over plays; empty where not all of them tell it."""
    told = [row["released"] for row in rows if row.get("released") is not None]
    return rounded(float(np.mean(told))) if told and len(told) == len(rows) else ""
