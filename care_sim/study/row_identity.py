"""What was asked for with a row: two rows of which the same was asked are of one task."""

from functools import lru_cache
from typing import Any

from care_sim.core.conditions import DEFAULTS
from care_sim.evaluation.sightings import ANNOTATED
from care_sim.study.results_formats import is_parameter
from care_sim.study.run_config import Row

USUAL = DEFAULTS | {"presence": ANNOTATED}
"""Parameters of a row that does not name them: rows of older versions lack what was added since."""
Task = frozenset[tuple[str, Any]]
"""The parameters of a task that are not the default, by name."""
_LABEL_NAMES = ("scene", "scenario", "policy", "budget")
_SEEDS = ("seed", "floor_seed")


def asked_with(row: Row) -> Row:
    """The parameters of a row that differ from the defaults."""
    asked = {
        name: value
        for name in _parameters(tuple(row))
        if (value := row[name]) is not None and value != USUAL.get(name)
    }
    # A row holds the digest of a file of camera detections. It counts only whether one was given,
    # so that the same command may replace its own rows after the file has changed.
    if "camera_detections" in asked:
        asked["camera_detections"] = True
    return asked


@lru_cache
def _parameters(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the parameters among columns. Thousands of rows share the same `names`."""
    return tuple(filter(is_parameter, names))


def identity(row: Row) -> Task:
    """Equal for rows of one task, whatever code played it."""
    return frozenset(asked_with(row).items())


def row_label(row: Row) -> str:
    """A short name for people: world, policy, budget, and seeds that are not 0."""
    main = [str(row[name]) for name in _LABEL_NAMES if row.get(name) is not None]
    return " ".join([*main, *(f"{name} {row[name]}" for name in _SEEDS if row.get(name))])
