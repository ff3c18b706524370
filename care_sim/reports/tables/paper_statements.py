"""Every statement of the paper's Sec. 5.6 beside what a study measured, as pure functions of its
rows.

Numbers are medians in metres; a median that is not detected ranks below every other. Where the
paper uses words and no number, the statement names a bound.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from care_sim.base.errors import counted
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import Cell, levels
from care_sim.reports.formatting import median
from care_sim.reports.table import Bold, Table
from care_sim.study.designs.paper import (
    CAMERA_POLICIES,
    DARTOUT_CAMERA,
    DARTOUT_HISTORY,
    DENSE_ALL_CAMERA_M,
    DENSE_CARE_M,
    DENSE_FULL_M,
    NO_COLLISION,
    PAPER_EPISODES,
    paper_cells,
)
from care_sim.study.run_config import Row

_CellsByName = dict[tuple[str, str, float, str], Cell]
"""By scenario, policy, budget and camera fault ('' without one)."""
_AT = "dart-out 10%: "


class Statement(NamedTuple):
    """Statement of the paper, its measurement here, and whether they agree."""

    text: str
    paper: str
    measured: str
    agrees: bool

    @property
    def verdict(self) -> str:
        """Whether statement and measurement agree, in a word."""
        return "agrees" if self.agrees else "DIFFERS"


def statements(rows: Sequence[Row]) -> list[Statement]:
    """All statements, when the rows cover every cell of the paper's study; else none."""
    found = {cell.key: cell for cell in levels(Frame(rows))}
    # A part of the study would agree with a part of the statements, and pass for all of them.
    if not paper_cells() <= set(found):
        return []
    cells: _CellsByName = {}
    for cell in (cell for key, cell in found.items() if key in paper_cells()):
        fault = " ".join(f"{name} {value}" for name, value in cell.setting.conditions)
        cells[cell.setting.world, cell.policy, cell.budget, fault] = cell
    return [*_dartout(cells), *_dense(cells), *_faults(cells), *_others(cells)]


def statement_tables(rows: Sequence[Row]) -> list[Table]:
    """All statements beside what was measured; none where not every cell was played."""
    said = statements(rows)
    if not said:
        return []
    lines = tuple(
        (each.text, each.paper, each.measured, each.verdict if each.agrees else Bold(each.verdict))
        for each in said
    )
    notes = ("Medians in metres; results/paper-replication.md explains what differs.",)
    columns = ("statement", "paper", "here", "verdict")
    title = "The paper's statements on the closed loop"
    return [Table(title, columns, lines, notes, (f'Paper: "{NO_COLLISION}"',))]


def in_short(rows: Sequence[Row]) -> list[str]:
    """How many statements hold and which do not, in a sentence; none as in `statements`."""
    said = statements(rows)
    if not said:
        return []
    differ = [each.text for each in said if not each.agrees]
    told = f"The paper: {len(said) - len(differ)} of {counted(len(said), 'statement')} hold"
    return [f"{told}. Not: {'; '.join(differ)}." if differ else f"{told}."]


def _dartout(cells: _CellsByName) -> Iterator[Statement]:
    camera = [cells["dartout", policy, 0.1, ""] for policy in CAMERA_POLICIES]
    history, full = cells["dartout", "history", 0.1, ""], cells["dartout", "full", 1.0, ""]
    passes = [_pass(cell) for cell in camera]
    # The shortest distance is the latest detection. The worst of the camera policies is held
    # against history.
    latest = min(camera, key=_median)
    about = f"about {DARTOUT_CAMERA.detection_m:.0f}"
    paper_pass, history_pass = DARTOUT_CAMERA.pass_m, DARTOUT_HISTORY.pass_m
    braking_share = DARTOUT_HISTORY.braked / PAPER_EPISODES
    yield Statement(
        f"{_AT}camera policies brake in every episode",
        f"{DARTOUT_CAMERA.braked}/{PAPER_EPISODES}",
        ", ".join(f"{cell.policy} {cell.braked}/{cell.episodes}" for cell in camera),
        all(cell.braked == cell.episodes for cell in camera),
    )
    yield Statement(
        f"{_AT}camera policies detect within 0.3 m of full",
        about,
        f"{_list(camera)}, full {_shown(full)}",
        max(_gap(cell, full) for cell in camera) <= 0.3,
    )
    yield Statement(
        f"{_AT}history detects at least 2 m later",
        f"{DARTOUT_HISTORY.detection_m} against {about}",
        f"{_shown(history)} against {_shown(latest)}",
        _median(latest) - _median(history) >= 2.0,
    )
    yield Statement(
        f"{_AT}history brakes in 3 of 5 episodes, to a tenth",
        f"{DARTOUT_HISTORY.braked}/{PAPER_EPISODES}",
        f"{history.braked}/{history.episodes}",
        abs(history.braked / history.episodes - braking_share) <= 0.1,
    )
    yield Statement(
        f"{_AT}camera policies pass at {paper_pass} m or more, history at {history_pass} m, "
        "to 0.5 m",
        f"{paper_pass} or more against {history_pass}",
        f"{min(passes):.1f} or more against {_pass(history):.1f}",
        min(passes) >= paper_pass and abs(_pass(history) - history_pass) <= 0.5,
    )


def _dense(cells: _CellsByName) -> Iterator[Statement]:
    care, camera = (cells["dense", policy, 0.03, ""] for policy in ("care", "all-camera"))
    full = cells["dense", "full", 1.0, ""]
    pairs = [
        (cells["dense", "all-camera", b, ""], cells["dense", "care", b, ""])
        for b in (0.05, 0.1, 0.2)
    ]
    yield Statement(
        "dense 3%: care detects within 0.5 m of full",
        f"{DENSE_CARE_M}, full {DENSE_FULL_M}",
        f"{_shown(care)}, full {_shown(full)}",
        _gap(care, full) <= 0.5,
    )
    yield Statement(
        "dense 3%: all-camera detects at least 3 m later than care",
        f"{DENSE_ALL_CAMERA_M} against {DENSE_CARE_M}",
        f"{_shown(camera)} against {_shown(care)}",
        _median(care) - _median(camera) >= 3.0,
    )
    yield Statement(
        "dense from 5%: all-camera and care within 0.5 m of each other",
        "they converge",
        ", ".join(f"{_shown(a)} against {_shown(b)} at {100 * a.budget:.0f}%" for a, b in pairs),
        all(_gap(a, b) <= 0.5 for a, b in pairs),
    )


def _faults(cells: _CellsByName) -> Iterator[Statement]:
    """A camera policy may not fall behind history, which asks no camera and so is its faultless
    self under latency.
    """
    faultless = cells["dartout", "history", 0.1, ""]
    for text, name in (
        ("missed detections up to 0.4", "false_negative_rate"),
        ("latency up to 2", "camera_latency"),
    ):
        faults = [f for _, policy, _, f in cells if f.startswith(name) and policy == "care"]
        pairs = [
            (
                min((cells["dartout", p, 0.1, fault] for p in CAMERA_POLICIES), key=_median),
                cells.get(("dartout", "history", 0.1, fault), faultless),
            )
            for fault in faults
        ]
        yield Statement(
            f"{_AT}{text} leaves every camera policy before history",
            "order unchanged",
            ", ".join(f"{_shown(a)} against {_shown(b)}" for a, b in pairs),
            all(_median(a) > _median(b) for a, b in pairs),
        )


def _others(cells: _CellsByName) -> Iterator[Statement]:
    group = [cell for cell in cells.values() if cell.setting.world == "cutin"]
    apart = _gap(max(group, key=_median), min(group, key=_median))
    said = "cut-in: all policies within 1 m"
    yield Statement(said, "no separation", _list(group), apart <= 1.0)
    collided = sum(cell.collisions for cell in cells.values())
    episodes = sum(cell.episodes for cell in cells.values())
    yield Statement("no episode collides", "0", f"{collided} of {episodes}", not collided)


def _median(cell: Cell) -> float:
    # Rounded as the tables show it, so that a verdict can be checked by eye.
    return -math.inf if cell.detection.median is None else round(cell.detection.median, 1)


def _gap(ours: Cell, theirs: Cell) -> float:
    """Distance between two medians; no gap is known where one is not detected."""
    gap = abs(_median(ours) - _median(theirs))
    # The difference of two rounded medians has an error in its last bits, which rounding takes away
    # again. Two that are both not detected differ by nan, which is no agreement.
    return round(gap, 1) if math.isfinite(gap) else math.inf


def _shown(cell: Cell) -> str:
    return median(cell.detection)


def _pass(cell: Cell) -> float:
    values = cell.closest_pass
    return round(values.median, 1) if values and values.median is not None else 0.0


def _list(cells: Sequence[Cell]) -> str:
    return ", ".join(f"{cell.policy} {_shown(cell)}" for cell in cells)
