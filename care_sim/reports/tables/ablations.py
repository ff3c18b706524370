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
from care_sim.reports.engine.tables import PAPER, under_headings
from care_sim.reports.formatting import interval, quarters
from care_sim.reports.protocol.formatting import claims_of_paper, papers, rounded
from care_sim.reports.protocol.paper import (
    NEAR_FIELD,
    PUBLISHED_CHANGES,
    PUBLISHED_ON_ALL_LEVELS,
    PUBLISHED_RELEASE,
    USUAL,
    LevelChange,
)
from care_sim.reports.table import Table, TableRow
from care_sim.study.designs import ablations as design
from care_sim.study.designs.ablations import Ablation
from care_sim.study.designs.variants import USUAL_VARIANT, FilmPlace, Place
from care_sim.study.rows.reading import Setting
from care_sim.study.run_config import FULL, Row

_OPEN_MEASURES = {
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
    """Say in a sentence what the full scan finds of the films; nothing if it was not played."""
    study = AblationStudy(rows)
    key = USUAL_VARIANT.key(FilmPlace(study.source, 1.0), FULL)
    found = {
        name: level(each, study.frame.units(each, key)) for name, each in study.measures.items()
    }
    levels = [f"{name.removesuffix(' %')} {value}%" for name, value in found.items() if value]
    return [f"The full scan finds: {', '.join(levels)}."] if levels else []


class AblationStudy:
    """The rows of the study, the ablations and measures of their loop, and where they were
    played. `has_paper`: the paper's figures stand beside those of these films.
    """

    def __init__(self, rows: Sequence[Row]):
        self.frame = Frame(rows)
        self.source: str = rows[0].get("source", "")
        self.has_paper = Setting(self.source).has_paper
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        self.ablations = design.OPEN_ABLATIONS if self.source else design.ABLATIONS
        self.measures: dict[str, Measure | Recall] = {"first detection m": DETECTION}
        self.places: Sequence[Place | FilmPlace] = design.ABLATION_PLACES
        if self.source:
            self.measures = {**_OPEN_MEASURES}
            self.places = [FilmPlace(self.source, budget) for budget in self.budgets]
        own = {FULL}
        for each in self.ablations:
            own |= {each.policy, *each.references, *(one.policy or FULL for one in each.levels)}
        self.joined = [policy for policy in self.frame.policies if policy not in own]


def _table(study: AblationStudy, ablation: Ablation) -> Table:
    usual, *keys = (
        each.key(study.places[0], ablation.policy) for each in (USUAL_VARIANT, *ablation.levels)
    )
    names = [
        f"{each.label} (usual)" if key == usual else each.label
        for each, key in zip(ablation.levels, keys, strict=True)
    ]
    lines = {
        f"{percent(place.budget) if study.source else place}, {name}": [
            *_levels(study, ablation, place, name),
            *_changes(study, ablation, place, name),
        ]
        for place in study.places
        for name in study.measures
    }
    said = [PUBLISHED_ON_ALL_LEVELS.get(ablation.title, "")]
    said += [
        claims.source
        for change, claims in PUBLISHED_CHANGES.items()
        if change.title == ablation.title and claims.any_at(study.budgets)
    ]
    notes = " ".join([*([_RELEASED] if study.source else []), *ablation.notes])
    return Table(
        f"{ablation.policy}: {ablation.title}",
        ("", *names),
        under_headings(lines),
        (notes, *study.frame.notes(ablation.beside(study.joined))),
        papers(filter(None, said)) if study.has_paper else (),
    )


def _levels(
    study: AblationStudy, ablation: Ablation, place: Place | FilmPlace, name: str
) -> Iterator[TableRow]:
    """Return the levels by one measure, with further columns."""
    frame, measure = study.frame, study.measures[name]
    keys = [each.key(place, ablation.policy) for each in ablation.levels]
    yield (ablation.policy, *(level(measure, frame.units(measure, key)) for key in keys))
    if not study.source:
        found = (quartiles([*frame.units(DETECTION, key).values()]) for key in keys)
        yield ("quartiles", *(quarters(each) if each else "" for each in found))
        yield ("braked", *(level(BRAKED, frame.units(BRAKED, key)) for key in keys))
    elif name == next(iter(study.measures)):
        yield ("released", *(_released(frame.of(key)) for key in keys))
        if (
            study.has_paper
            and ablation.title == design.GUARD.title
            and place.budget in PUBLISHED_RELEASE
        ):
            release = rounded(PUBLISHED_RELEASE[place.budget])
            yield (PAPER, *("" if each.parameters else release for each in ablation.levels))


def _changes(
    study: AblationStudy, ablation: Ablation, place: Place | FilmPlace, name: str
) -> Iterator[TableRow]:
    """Yield the differences of the levels from the usual level and from each reference, by one
    measure; under each line the paper's claim.
    """
    frame, measure = study.frame, study.measures[name]
    usual = USUAL_VARIANT.key(place, ablation.policy)
    for base in (USUAL, *ablation.beside(study.joined)):
        changes: list[str] = []
        told: list[str] = []
        for each in ablation.levels:
            ours = each.key(place, ablation.policy)
            # The others feel the conditions of a level and not its parameters, which are the own
            # ones of the policy.
            theirs = usual if base == USUAL else each.for_others().key(place, base)
            # The usual level stands in every ablation, compared with nothing.
            found = None if ours == theirs else frame.contrast(measure, ours, theirs)
            changes.append(interval(found))
            claims = None
            if study.has_paper and isinstance(measure, Recall):
                change = ablation.title, each.label, base, measure.ratio, measure.within
                claims = PUBLISHED_CHANGES.get(LevelChange(*change))
            told.append("".join(claims_of_paper(claims, [place.budget])))
        yield (f"minus {frame.marked(base)}", *changes)
        if any(told):
            yield (PAPER, *told)


def _released(rows: Sequence[Row]) -> str:
    """The mean over plays; empty where not all of them tell it."""
    told = [row["released"] for row in rows if row.get("released") is not None]
    return rounded(float(np.mean(told))) if told and len(told) == len(rows) else ""
