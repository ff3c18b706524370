"""Every statement of the paper's Sec. 5.6 beside what a study measured, as pure functions of its
rows.

Numbers are medians in metres; a median that is not detected ranks below every other. What the paper
says in words is put as a bound, which the statement names.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from care_sim.reports.cells import Cell, summarise
from care_sim.reports.formatting import median
from care_sim.study.designs.paper import (
    CAMERA_POLICIES,
    DARTOUT_CAMERA,
    DARTOUT_HISTORY,
    DENSE_ALL_CAMERA_M,
    DENSE_CARE_M,
    DENSE_FULL_M,
    PAPER_EPISODES,
    paper_cells,
)
from care_sim.study.run_config import Row

_CellsByName = dict[tuple[str, str, float, str], Cell]
"""By scenario, policy, budget and camera fault ('' without one)."""


@dataclass(frozen=True)
class Statement:
    """What the paper says, what was measured, and whether they agree."""

    text: str
    paper: str
    measured: str
    agrees: bool

    @property
    def verdict(self) -> str:
        """Whether they agree, in a word."""
        return "agrees" if self.agrees else "DIFFERS"

    def __str__(self) -> str:
        return f"{self.verdict}: {self.text}. Paper: {self.paper}. Here: {self.measured}."


def statements(rows: Sequence[Row]) -> list[Statement]:
    """All statements, when the rows cover every cell of the paper's study; else none."""
    found = {cell.key: cell for cell in summarise(rows)}
    # A part of the study would agree with a part of the statements, and pass for all of them.
    if not paper_cells() <= set(found):
        return []
    cells = {_key(cell): cell for key, cell in found.items() if key in paper_cells()}
    return [
        *_dartout(cells),
        *_dense(cells),
        _cutin(cells),
        *_faults(cells),
        _collisions(list(cells.values())),
    ]


def _key(cell: Cell) -> tuple[str, str, float, str]:
    fault = " ".join(f"{name} {value}" for name, value in cell.setting.conditions)
    return cell.setting.world, cell.policy, cell.budget, fault


def _dartout(cells: _CellsByName) -> list[Statement]:
    camera = [cells["dartout", policy, 0.1, ""] for policy in CAMERA_POLICIES]
    history = cells["dartout", "history", 0.1, ""]
    full = cells["dartout", "full", 1.0, ""]
    gaps = [_gap(cell, full) for cell in camera]
    passes = [_pass(cell) for cell in camera]
    # The shortest distance is the latest detection. The worst of the camera policies is held
    # against history.
    latest = min(camera, key=_median)
    at = "dart-out 10%: "
    about = f"about {DARTOUT_CAMERA.detection_m:.0f}"
    camera_pass = DARTOUT_CAMERA.pass_m
    history_pass = DARTOUT_HISTORY.pass_m
    braking_share = DARTOUT_HISTORY.braked / PAPER_EPISODES
    return [
        Statement(
            at + "camera policies brake in every episode",
            f"{DARTOUT_CAMERA.braked}/{PAPER_EPISODES}",
            ", ".join(f"{cell.policy} {cell.braked}/{cell.episodes}" for cell in camera),
            all(cell.braked == cell.episodes for cell in camera),
        ),
        Statement(
            at + "camera policies detect within 0.3 m of full",
            about,
            f"{_list(camera)}, full {_shown(full)}",
            max(gaps) <= 0.3,
        ),
        Statement(
            at + "history detects at least 2 m later",
            f"{DARTOUT_HISTORY.detection_m} against {about}",
            f"{_shown(history)} against {_shown(latest)}",
            _median(latest) - _median(history) >= 2.0,
        ),
        Statement(
            at + "history brakes in 3 of 5 episodes, to a tenth",
            f"{DARTOUT_HISTORY.braked}/{PAPER_EPISODES}",
            f"{history.braked}/{history.episodes}",
            abs(history.braked / history.episodes - braking_share) <= 0.1,
        ),
        Statement(
            f"{at}camera policies pass at {camera_pass} m or more, history at {history_pass} m, "
            "to 0.5 m",
            f"{camera_pass} or more against {history_pass}",
            f"{min(passes):.1f} or more against {_pass(history):.1f}",
            min(passes) >= camera_pass and abs(_pass(history) - history_pass) <= 0.5,
        ),
    ]


def _dense(cells: _CellsByName) -> list[Statement]:
    care, camera, full = (
        cells["dense", p, b, ""] for p, b in (("care", 0.03), ("all-camera", 0.03), ("full", 1.0))
    )
    pairs = [
        (cells["dense", "all-camera", b, ""], cells["dense", "care", b, ""])
        for b in (0.05, 0.1, 0.2)
    ]
    return [
        Statement(
            "dense 3%: care detects within 0.5 m of full",
            f"{DENSE_CARE_M}, full {DENSE_FULL_M}",
            f"{_shown(care)}, full {_shown(full)}",
            _gap(care, full) <= 0.5,
        ),
        Statement(
            "dense 3%: all-camera detects at least 3 m later than care",
            f"{DENSE_ALL_CAMERA_M} against {DENSE_CARE_M}",
            f"{_shown(camera)} against {_shown(care)}",
            _median(care) - _median(camera) >= 3.0,
        ),
        Statement(
            "dense from 5%: all-camera and care within 0.5 m of each other",
            "they converge",
            ", ".join(
                f"{_shown(a)} against {_shown(b)} at {100 * a.budget:.0f}%" for a, b in pairs
            ),
            all(_gap(a, b) <= 0.5 for a, b in pairs),
        ),
    ]


def _cutin(cells: _CellsByName) -> Statement:
    group = [cell for cell in cells.values() if cell.setting.world == "cutin"]
    first = max(group, key=_median)
    last = min(group, key=_median)
    return Statement(
        "cut-in: all policies within 1 m", "no separation", _list(group), _gap(first, last) <= 1.0
    )


def _faults(cells: _CellsByName) -> list[Statement]:
    """A camera policy may not fall behind history, which asks no camera and so is its faultless
    self under latency.
    """
    made = []
    for text, name in (
        ("missed detections up to 0.4", "false_negative_rate"),
        ("latency up to 2", "camera_latency"),
    ):
        faults = [
            fault for _, policy, _, fault in cells if fault.startswith(name) and policy == "care"
        ]
        pairs = [
            # History has no rows under latency, which it does not feel: its faultless rows stand
            # for them.
            (_slowest(cells, f), cells.get(("dartout", "history", 0.1, f), _history(cells)))
            for f in faults
        ]
        measured = (f"{_shown(a)} against {_shown(b)}" for a, b in pairs)
        agrees = all(_median(a) > _median(b) for a, b in pairs)
        said = f"dart-out 10%: {text} leaves every camera policy before history"
        made.append(Statement(said, "order unchanged", ", ".join(measured), agrees))
    return made


def _slowest(cells: _CellsByName, fault: str) -> Cell:
    return min((cells["dartout", policy, 0.1, fault] for policy in CAMERA_POLICIES), key=_median)


def _history(cells: _CellsByName) -> Cell:
    return cells["dartout", "history", 0.1, ""]


def _collisions(cells: Sequence[Cell]) -> Statement:
    collided = sum(cell.collisions for cell in cells)
    return Statement(
        "no episode collides", "0", f"{collided} of {sum(c.episodes for c in cells)}", not collided
    )


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
