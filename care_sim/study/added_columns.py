"""Columns that a study adds to its rows when it writes them: what only rows side by side, or the
policies, tell.
"""

from collections.abc import Sequence

from care_sim.policies import tags_of
from care_sim.study.row_reading import detection, setting_of
from care_sim.study.run_config import Row
from care_sim.study.settings import Setting

Worlds = dict[tuple[Setting, int], Row]


def annotated(rows: Sequence[Row]) -> list[Row]:
    """The rows with three more columns.

    `tags` of the policy, joined by '+'. `regret_m`: detection distance of the full scan of the same
    world and seed minus this row's, 0 at best, None where the full scan was not run. `censored`:
    the policy, or that full scan, never detected the actor, so that `regret_m` counts with the most
    its distance can have been and is a bound.
    """
    full = {(setting_of(row), row["seed"]): row for row in rows if row["policy"] == "full"}
    return [{**row, **_regret(row, full)} for row in tagged(rows)]


def tagged(rows: Sequence[Row]) -> list[Row]:
    """The rows with the column `tags`."""
    return [{**row, "tags": "+".join(tags_of(row["policy"]))} for row in rows]


def _regret(row: Row, full: Worlds) -> Row:
    bound = full.get((setting_of(row).for_full(), row["seed"]))
    ours = detection(row)
    if bound is None:
        return {"regret_m": None, "censored": ours.censored}
    theirs = detection(bound)
    return {"regret_m": theirs.value - ours.value, "censored": ours.censored or theirs.censored}
