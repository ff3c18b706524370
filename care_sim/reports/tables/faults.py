"""How detection, braking and clearance hold up as every fault grows, and where the order of
policies changes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

from care_sim.reports.cells import Played
from care_sim.reports.contrasts import Contrast
from care_sim.reports.formatting import interval, median
from care_sim.reports.summary import Cell
from care_sim.reports.table import Bold, Table
from care_sim.study.designs.levels import Level, Place
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.task import Row

PLACES = (Place("dartout", 0.10), Place("dense", 0.03))
"""The paper's own: the budget at which it injects faults, and the one at which it tells the
reserves apart.
"""
POLICIES = ("history", "all-camera", "care", "full")
PAIRS = (("care", "history"), ("care", "all-camera"), ("all-camera", "history"))
BLACKOUT_START_S = 2.0
"""The person comes into the camera's view 2.4 to 2.9 s after the start."""
DEAD_ROWS = ((11,), (10, 11), (10, 11, 12), (9, 10, 11, 12))
"""Grown out of the middle of the rows that meet a person at the full scan's 16 m, 1 to 6 degrees
below the horizon.
"""
ORDER = (
    "How the first named stands to the second at the first strength, and from which strength on "
    "otherwise. > : it detects earlier, interval without zero and gate met; < : it detects later, "
    "likewise; = : neither."
)


@dataclass(frozen=True)
class Fault:
    """A fault from none of it (the first level) to much of it; the labels of the levels are its
    strength in `unit`.
    """

    title: str
    unit: str
    levels: tuple[Level, ...]
    notes: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Title and unit."""
        return f"{self.title}, {self.unit}"


def _growing(parameter: str, *values: float, start: float = 0, **given: Any) -> tuple[Level, ...]:
    first = Level(f"{start:g}", given if start else {})
    return (first, *(Level(f"{value:g}", {parameter: value, **given}) for value in values))


FAULTS = (
    Fault("missed objects", "share", _growing("false_negative_rate", 0.2, 0.4, 0.6, 0.8, 1.0)),
    Fault(
        "misses in bursts",
        "keyframes, at a share of 0.4",
        _growing("false_negative_burst", 5, 10, 20, start=1, false_negative_rate=0.4),
    ),
    Fault(
        "misses growing with distance",
        "share a metre",
        _growing("false_negative_per_m", 0.01, 0.02, 0.04),
    ),
    Fault(
        "false detections",
        "boxes a picture",
        _growing("false_positive_rate", 1.0, 2.0, 4.0, 8.0, 16.0),
    ),
    Fault("latency", "keyframes", _growing("camera_latency", 1, 2, 3, 5)),
    Fault("jitter of the latency", "most keyframes", _growing("camera_jitter", 1, 2, 4)),
    Fault(
        f"blackout from {BLACKOUT_START_S:.1f} s",
        "s",
        _growing("blackout_s", 0.5, 1.0, 2.0, blackout_start_s=BLACKOUT_START_S),
    ),
    Fault(
        "camera turned",
        "sigma in degrees",
        _growing("camera_rotation_sigma_deg", 0.5, 1.0, 2.0, 4.0),
    ),
    Fault("camera shifted", "sigma in m", _growing("camera_position_sigma_m", 0.05, 0.1, 0.2)),
    Fault("lost returns", "share", _growing("lidar_dropout", 0.1, 0.2, 0.4, 0.6)),
    Fault(
        "range noise",
        "sigma in m",
        _growing("lidar_range_sigma", 0.02, 0.1, 0.5),
        (
            "The proxy detector's boxes are true whatever the ranges; of the study's policies "
            "none reads ranges.",
        ),
    ),
    Fault(
        "dead rows",
        "rows",
        (Level("0"), *(Level(f"{len(rows)}", {"lidar_dead_rows": rows}) for rows in DEAD_ROWS)),
    ),
    Fault("noise of the car's speed", "sigma in m/s", _growing("ego_speed_sigma", 0.25, 0.5, 1.0)),
)


def configurations(seeds: Sequence[int], also: Sequence[str] = ()) -> list[EpisodeConfig]:
    """Every policy at every strength of every fault in both places; `also` are further policies."""
    made = [
        config
        for place, fault in product(PLACES, FAULTS)
        for level in fault.levels
        for config in level.configurations(place, [*POLICIES, *also], seeds)
    ]
    return list(dict.fromkeys(made))


def pairs_of(played: Played) -> list[tuple[str, str]]:
    """The pairs of policies whose order is followed."""
    return [*PAIRS, *(("care", policy) for policy in played.policies if policy not in POLICIES)]


def policies_of(played: Played) -> list[str]:
    """The policies of the study, then those that joined in."""
    return list(dict.fromkeys([*POLICIES, *played.policies]))


def fault_tables(rows: Sequence[Row]) -> list[Table]:
    """Where the order changes, then a table a fault with levels and paired differences."""
    played = Played(rows)
    return [_order_table(played), *(_fault_table(fault, played) for fault in FAULTS)]


def order(pair: tuple[str, str], fault: Fault, place: Place, played: Played) -> str:
    """How two policies stand as the fault grows: '>' where the first detects earlier by a
    difference that counts, '<' where the second does, '=' elsewhere; bold when it changes.
    Strengths that were not played are passed over.
    """
    found = [(level.label, _difference(pair, level, place, played)) for level in fault.levels]
    signs = [(label, _sign(difference)) for label, difference in found if difference]
    changes = [
        f"{sign} from {label}" for (_, before), (label, sign) in pairwise(signs) if sign != before
    ]
    text = ", ".join([*(sign for _, sign in signs[:1]), *changes])
    return Bold(text) if changes else text


def _difference(
    pair: tuple[str, str], level: Level, place: Place, played: Played
) -> Contrast | None:
    ours, theirs = (level.key(place, policy) for policy in pair)
    return played.difference(ours, theirs)


def _sign(difference: Contrast) -> str:
    return "=" if not difference.counts else ">" if difference.mean > 0 else "<"


def _order_table(played: Played) -> Table:
    pairs = pairs_of(played)
    lines: list[tuple[str, ...]] = []
    for place in PLACES:
        lines.append((str(place),))
        lines += [
            (fault.label, *(order(pair, fault, place, played) for pair in pairs))
            for fault in FAULTS
        ]
    columns = ("fault", *(" : ".join(map(played.marked, pair)) for pair in pairs))
    return Table(
        "Where the order of policies changes",
        columns,
        tuple(lines),
        (ORDER, *played.notes(played.policies)),
    )


def _fault_table(fault: Fault, played: Played) -> Table:
    columns = (fault.unit, *(level.label for level in fault.levels))
    lines = [line for place in PLACES for line in _blocks(fault, place, played)]
    notes = (*fault.notes, *played.notes(played.policies))
    return Table(fault.title, columns, tuple(lines), notes, terminal=False)


def _blocks(fault: Fault, place: Place, played: Played) -> Iterator[tuple[str, ...]]:
    """A block of policies for each measure, and one of paired differences."""
    for name, entry in (
        ("first detection, m", _detection),
        ("braked", _braked),
        ("clearance, m", _clearance),
    ):
        yield (f"{place}: {name}",)
        for policy in policies_of(played):
            cells = (played.cell(level.key(place, policy)) for level in fault.levels)
            yield (played.marked(policy), *(entry(cell) if cell else "" for cell in cells))
    yield (f"{place}: first detection of care minus, m",)
    for policy in policies_of(played):
        if policy != "care":
            differences = (
                _difference(("care", policy), level, place, played) for level in fault.levels
            )
            yield (played.marked(policy), *map(interval, differences))


def _detection(cell: Cell) -> str:
    return median(cell.detection)


def _braked(cell: Cell) -> str:
    return f"{cell.braked}/{cell.episodes}"


def _clearance(cell: Cell) -> str:
    return median(cell.clearance)
