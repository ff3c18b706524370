"""`care-sim list`: what can be named."""

import importlib
import shutil
import textwrap

from care_sim.base.errors import printable
from care_sim.commands.options.watching import List

_LINES = {
    "policies": "policies.listing:policy_paragraphs",
    "agents": "training.agents:agent_lines",
    "scenarios": "scenarios.listing:scenario_lines",
    "sources": "sources.named:source_lines",
    "detectors": "perception.detectors:detector_lines",
    "sensors": "sensors.setups:setup_lines",
    "engines": "sensors.engines:engine_lines",
}
"""Functions that return the lines of each list. Only the room of the list is imported."""


def show(options: List) -> int:
    """Print the list, as wide as the terminal."""
    module, function = _LINES[options.kind].split(":")
    for lines in getattr(importlib.import_module(f"care_sim.{module}"), function)():
        print(*(_wrapped(printable(line)) for line in lines.split("\n")), sep="\n")
    return 0


def _wrapped(line: str) -> str:
    """The line, broken at words where the terminal is narrower; what goes on is indented."""
    return textwrap.fill(
        line,
        shutil.get_terminal_size().columns,
        subsequent_indent=" " * 8,
        break_long_words=False,
        break_on_hyphens=False,
    )
