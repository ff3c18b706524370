"""Short findings of a study: the best policy against the best control at every budget of either
loop. Also the table of levels that ends a study on a terminal, and the sentences after its tables.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from care_sim.base.errors import counted, percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.controls import BEST_CONTROL, best_control, is_control, shared_units
from care_sim.reports.engine.levels import level
from care_sim.reports.engine.measures import (
    AVOIDED,
    DETECTION,
    GATE_POINTS,
    OPEN_LOOP,
    Measure,
    Recall,
    Units,
    loop_of,
)
from care_sim.reports.engine.parts import Part
from care_sim.reports.formatting import MARKS, emphasised, ends, signed
from care_sim.reports.protocol.formatting import papers
from care_sim.reports.protocol.paper import PAPER_BUDGETS
from care_sim.reports.protocol.quotes import GATE
from care_sim.reports.protocol.rows import HISTORY, plays_by_setting, settings
from care_sim.reports.table import Table, TableRow
from care_sim.study.rows.reading import setting_of, stops_for_nothing
from care_sim.study.run_config import FULL, REFERENCE, Row

_SIGHTINGS = Recall(FIRST_SIGHTING)
_CHOSEN = "Best policy and best control are chosen per budget on these results, which favours both."
_MAIN = (HISTORY, "all-camera", REFERENCE)
_OTHERS = 2
"""Further policies in the table of levels."""


@dataclass(frozen=True)
class Lead:
    """Lead of one policy over another in a setting at a budget. `measure` carries its unit;
    `difference` is `first` minus `second`, None without a `second`, and matters from `gate` on.
    """

    setting: str
    budget: float
    measure: str
    gate: float
    first: str
    second: str | None
    difference: Contrast | None

    @property
    def sign(self) -> int:
        """1 if the first is ahead, -1 if the second is, 0 if they tie."""
        return self.difference.sign if self.difference else 0

    @property
    def row(self) -> TableRow:
        """The row of a table."""
        names = (self.setting, percent(self.budget), self.measure, self.first, self.second or "")
        if self.difference is None:
            return (*names, "", "", "")
        shown = emphasised(self.difference, signed(self.difference))
        ahead = self.first if self.sign > 0 else self.second or ""
        reached = ahead if self.difference.reaches(self.gate) else "no"
        return (*names, shown, ends(self.difference), reached)


def leads(rows: Sequence[Row], plain: bool = False) -> list[Lead]:
    """Return the lead of the best policy over the best control at every budget of every setting, or
    of the `plain` ones. Measures are first sightings, or first detections and, if any, collisions.

    The best are chosen among policies that a car can have, by the seeds or scenes that all of them
    have. Their difference is over the seeds or scenes that both have.
    """
    is_open = loop_of(rows) is OPEN_LOOP
    found = (
        _lead(part, budget, measure)
        for part in settings(rows, plain)
        for budget in part.budgets
        for measure in ((_SIGHTINGS,) if is_open else (DETECTION, part.avoided))
    )
    return [lead for lead in found if lead]


def leads_tables(rows: Sequence[Row], plain: bool = False) -> list[Table]:
    """The best policy against the best control; none without leads."""
    title = f"The best policy against the {BEST_CONTROL}"
    return _table(title, "best", BEST_CONTROL, leads(rows, plain), _CHOSEN)


def gate_tables(rows: Sequence[Row]) -> list[Table]:
    """CARE against history at the paper's budgets, in the settings of the paper."""
    found = [
        Lead(plays.setting.label, budget, *_named(_SIGHTINGS), REFERENCE, HISTORY, difference)
        for plays in plays_by_setting(rows)
        # The gate was fixed for the plain setting, so that no fault is judged by it.
        if plays.setting.as_in_paper
        for budget in plays.budgets
        if budget in PAPER_BUDGETS
        and (difference := plays.contrast(_SIGHTINGS, REFERENCE, HISTORY, budget))
    ]
    made = _table("CARE against history: the paper's gate of five points", "policy", "minus", found)
    return [replace(table, quotes=papers((GATE,))) for table in made]


def headline(rows: Sequence[Row]) -> Table:
    """Median first detections, or recalls of first sightings, of the main policies, of the best
    control and of the full scan; of the closed loop in plain settings.
    """
    measure = loop_of(rows).measures[0]
    parts = settings(rows, plain=measure is DETECTION)
    tags = {policy: own for part in parts for policy, own in part.tags.items()}
    played = [policy for policy in tags if not is_control(tags[policy])]
    main = [policy for policy in _MAIN if policy in played]
    # A variant of CARE in the paper, which lies on CARE in all its scenes.
    others = [policy for policy in played if policy not in (*_MAIN, "care-sbf")][:_OTHERS]
    shown = [*main, *others] or played
    control = (BEST_CONTROL,) if len(played) < len(tags) else ()
    lines: list[TableRow] = []
    for part in parts:
        for budget in part.budgets:
            levels = {
                policy: level(measure, part.units(measure, policy, budget))
                for policy in (*tags, FULL)
            }
            best = part.best_control(measure, budget)
            named = (f"{levels[best]} {best}" if best else "",) if control else ()
            entries = (levels[policy] for policy in shown)
            lines.append((part.setting.label, percent(budget), *entries, *named, levels[FULL]))
    columns = ("scenario", "budget", *shown, *control, FULL)
    title = (
        "First detection: median, m"
        if measure is DETECTION
        else "First sightings detected in their first keyframe, %"
    )
    return Table(title, columns, tuple(lines), whole=columns[1:], names=2)


def ties(rows: Sequence[Row], plain: bool = False) -> list[str]:
    """One sentence per measure: how often the best policy is ahead of the best control."""
    found = [lead for lead in leads(rows, plain) if lead.second]
    sentences = []
    for measure in dict.fromkeys(lead.measure for lead in found):
        signs = [lead.sign for lead in found if lead.measure == measure]
        sentences.append(
            f"The best control ties the best policy in {signs.count(0)} of "
            f"{counted(len(signs), 'comparison')} ({measure}), leads in {signs.count(-1)}, "
            f"trails in {signs.count(1)}."
        )
    return sentences


def collisions(rows: Sequence[Row]) -> list[str]:
    """Collisions over all rows. Names those in which a body ran into the car, and the stops for
    nothing, where there are any.
    """
    hit_by = sum(row.get("hit_at_front") is False for row in rows)
    needless = sum(map(stops_for_nothing, rows))
    return [
        f"Collisions: {sum(row['collision'] for row in rows)} in {counted(len(rows), 'episode')}"
        + (f"; in {hit_by} another body ran into the car" if hit_by else "")
        + (f"; {counted(needless, 'stop')} for nothing, which avoid none" if needless else "")
        + "."
    ]


def shared_conditions(rows: Sequence[Row]) -> list[str]:
    """The conditions of all episodes, in a sentence where they are not the default. The parameters
    of a scenario are a part of the study.
    """
    # The full scan does not feel all conditions.
    own = [row for row in rows if row["policy"] != FULL] or rows
    found = [
        setting_of({name: row[name] for name in row if not name.startswith("scenario.")})
        for row in own
    ]
    shared = set.intersection(*({*setting.conditions} for setting in found))
    kept = replace(found[0], conditions=tuple(c for c in found[0].conditions if c in shared))
    changed = kept.label.removeprefix(f"{kept.world}, ")
    return [f"Conditions of all episodes: {changed}."] if shared else []


def _named(measure: Measure | Recall) -> tuple[str, float]:
    """Return the name of a measure with its unit, and the gate of a lead."""
    if isinstance(measure, Recall):
        return f"{measure.heading.lower()}, points", GATE_POINTS
    # Whether a full scan was played changes the collisions that count, and not the name.
    shown = DETECTION if measure is DETECTION else AVOIDED
    return shown.heading.lower(), shown.gate


def _table(title: str, first: str, second: str, found: Sequence[Lead], *notes: str) -> list[Table]:
    if not found:
        return []
    columns = ("setting", "budget", "measure", first, second, "difference", "interval")
    rows = tuple(lead.row for lead in found)
    return [Table(title, (*columns, "gate reached by"), rows, notes, whole=columns[1:], names=3)]


def _lead(part: Part, budget: float, measure: Measure | Recall) -> Lead | None:
    """The best that is no control against the best control; None without two policies."""
    real = [policy for policy, tags in part.tags.items() if {*MARKS}.isdisjoint(tags)]
    # A policy that lacks a hard seed or scene would lead by that.
    units = shared_units({policy: part.units(measure, policy, budget) for policy in real})
    if len(units) < 2 or not _differs(measure, units):
        return None
    levels = {policy: measure.mean(own) for policy, own in units.items()}
    best = best_control({p: at for p, at in levels.items() if not is_control(part.tags[p])})
    if best is None:
        return None
    control = best_control({p: at for p, at in levels.items() if is_control(part.tags[p])})
    found = part.contrast(measure, best, control, budget) if control else None
    return Lead(part.setting.label, budget, *_named(measure), best, control, found)


def _differs(measure: Measure | Recall, units: dict[str, Units]) -> bool:
    """Whether there is anything to compare: any first detection, or any collision."""
    if isinstance(measure, Recall):
        return True
    readings = [reading for own in units.values() for reading in own.values()]
    if len(readings) < FEWEST_PAIRS * len(units):
        return False
    if measure is DETECTION:
        return any(not reading.censored for reading in readings)
    return any(reading.value < 100 for reading in readings)
