"""The help of a command as it is shown: as wide as the terminal, its options grouped by purpose."""

import io
import re
import shutil
import textwrap
from typing import TextIO

PURPOSES = {
    "what is played": (
        "env, env-parameters, drawn, without, scenario, scenarios, scenario-parameters, "
        "source, split, version, scene, scenes, tests, tables, step-kph, every, presence, "
        "policy, policies, policy-parameters, also, against, name, quick, sealed, budget, "
        "budgets, factors, seed, seeds, training-seeds, floor-seeds, episode, episodes, frames, "
        "false-negative-rates, camera-latencies, all, verify, minus"
    ),
    "sensor and detector": (
        "sensor, sensors, detector, detectors, detector-parameters, least-scores, "
        "camera-detections, camera-times, empty-boxes, sweeps, reference, topics"
    ),
    "LiDAR": (
        "lidar-stated-range-m, lidar-stated-reflectance, visibility-m, rain-mm-h, "
        "lidar-divergence-mrad, lidar-returns, lidar-sweep-s, lidar-compensated, lidar-crosstalk, "
        "lidar-range-sigma, lidar-dropout, lidar-dead-rows"
    ),
    "camera": (
        "camera-profile, false-negative-rate, false-negative-per-m, false-negative-burst, "
        "false-positive-rate, camera-latency, camera-latency-s, camera-jitter, blackout-start-s, "
        "blackout-s, camera-rotation-sigma-deg, camera-position-sigma-m, camera-confidence"
    ),
    "what the car knows of itself": (
        "ego-speed-sigma, ego-position-sigma-m, ego-yaw-sigma-deg, ego-pose-correlation-s"
    ),
    "how the scan is chosen and read": (
        "engine, min-returns, reserve-fraction, floor, floor-seed, azimuth-margin, "
        "elevation-margin, cell-order, firing"
    ),
    "how the car brakes": (
        "driver, brake-mps2, brake-reaction-s, brake-standstill-m, brake-horizon-s, "
        "brake-side-margin-m, brake-release-s, brake-for-oncoming, comfort-mps2"
    ),
    "what is seen and done": "action, azimuths, elevations, columns, rows, gain",
    "how it learns": (
        "hyperparameters, tune, steps, learning-rate, discount, rollout, batch, epochs, noise, "
        "hidden, memory, evaluate-every"
    ),
    "what is measured": "seconds, repeats, samples, resets",
    "what is written": (
        "out, force, resume, tensorboard, picture, at, video, record, export, view, web, page, "
        "official, write, dataset, chart, video-start"
    ),
    "the machine": "workers, cluster, environments, processes, threads",
    "help": "help",
}
"""The options of all commands, as they are written, by what they are for."""

_PURPOSE_OF = {
    option: purpose for purpose, options in PURPOSES.items() for option in options.split(", ")
}
_OTHERS = "options"
"""The heading of tyro's box, and of what `PURPOSES` does not name."""
_ENTRY = re.compile(r"│ (?:-\w.*?, )?--(?:no-)?([a-z0-9-]+)")
_TOP, _BOTTOM = f"╭─ {_OTHERS} ─", "╰"
_NARROWEST = 40
"""Columns of a terminal below which names of options are cut, and headings would be."""


class Captured(io.StringIO):
    """What a help prints, in the characters of the real output and without colours, so that a
    letter of it is a column.
    """

    def __init__(self, output: TextIO) -> None:
        super().__init__()
        self._output = output

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Without UTF-8 no frames are drawn."""
        return self._output.encoding


def grouped(text: str) -> str:
    """A help with its box of options parted into one box per purpose, in the order of `PURPOSES`.
    A help without a frame, or for a narrow terminal, stays as it is.
    """
    lines = text.splitlines()
    first = next((n for n, line in enumerate(lines) if line.startswith(_TOP)), None)
    if first is None or shutil.get_terminal_size().columns < _NARROWEST:
        return text
    last = next(n for n in range(first, len(lines)) if lines[n].startswith(_BOTTOM))
    boxes: dict[str, list[str]] = {purpose: [] for purpose in (*PURPOSES, _OTHERS)}
    purpose = _OTHERS
    for line in lines[first + 1 : last]:
        # The lines of an option's help follow that of its name.
        if named := _ENTRY.match(line):
            purpose = _PURPOSE_OF.get(named[1], _OTHERS)
        boxes[purpose].append(line)
    width = len(lines[first])
    drawn = [
        line
        for purpose, own in boxes.items()
        if own
        for line in (f"╭─ {purpose} ".ljust(width - 1, "─") + "╮", *own, lines[last])
    ]
    return "\n".join([*lines[:first], *drawn, *lines[last + 1 :], ""])


def wrapped(text: str) -> str:
    """A help whose lines outside boxes are as wide as the terminal at most: tyro fits the boxes
    alone.
    """
    columns = shutil.get_terminal_size().columns
    return "".join(
        textwrap.fill(line, columns, subsequent_indent=_indent(line), break_on_hyphens=False) + "\n"
        if len(line) > columns
        else line + "\n"
        for line in text.splitlines()
    )


def _indent(line: str) -> str:
    """That of the lines after the first: what a usage lists stands below its command."""
    return " " * 7 if line.startswith("usage: ") else ""
