"""Controls that a contender has to beat, and the best of them."""

from collections.abc import Mapping

from care_sim.base.errors import percent
from care_sim.reports.engine.measures import Measure, Recall, Units
from care_sim.reports.formatting import MARKS

BEST_CONTROL = "best control"
"""Begin of the line that names the control at every budget."""


def named_by_budget(controls: Mapping[float, str]) -> str:
    """Return the best control of each budget, in words: each control once, with its budgets."""
    if len({*controls.values()}) == 1:
        return f"{next(iter(controls.values()))} at every budget"
    budgets: dict[str, list[str]] = {}
    for budget, control in controls.items():
        budgets.setdefault(control, []).append(percent(budget))
    return " and ".join(f"{control} at {', '.join(own)}" for control, own in budgets.items())


def is_control(tags: tuple[str, ...]) -> bool:
    """Return True if a policy with these tags is a control that a car can have."""
    # A policy that looks the episode up, or knows the truth, is a warning or a bound, and no
    # reference to beat.
    return "control" in tags and not {*tags} & {*MARKS}


def best_control(levels: Mapping[str, float | None]) -> str | None:
    """Return the control of the highest level, the first of equal ones; None without levels."""
    known = {policy: level for policy, level in levels.items() if level is not None}
    return max(known, key=lambda policy: known[policy], default=None)


def best_of(measure: Measure | Recall, found: Mapping[str, Units]) -> str | None:
    """The control with the highest mean, given what was measured of each, over the units that all
    of them have; None without one.
    """
    # A control that lacks a hard seed or scene would win by that.
    shared = shared_units(found)
    return best_control({policy: measure.mean(units) for policy, units in shared.items()})


def shared_units(found: Mapping[str, Units]) -> dict[str, Units]:
    """Return the measurements of each policy over the units that all of them have; without policies
    that were not measured.
    """
    played = {policy: units for policy, units in found.items() if units}
    shared = set.intersection(*map(set, played.values())) if played else set()
    return {
        policy: {unit: units[unit] for unit in units if unit in shared}
        for policy, units in played.items()
    }
