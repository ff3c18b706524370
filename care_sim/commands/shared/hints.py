"""A way on for who writes an option that a command lacks: one of a near name, one of that meaning,
or the command that has it.
"""

import re
from collections.abc import Mapping
from difflib import SequenceMatcher

from care_sim.commands.entries import COMMANDS
from care_sim.commands.shared.parsing import UNRECOGNIZED, option_helps

_MOST_OPTIONS = ("sweep", "protocol")
"""Of the closed and of the open loop, the commands that take every condition."""
_MOST_TOLD = 3
_NEAR = 0.7
"""Least likeness of a mistyped name: `policy` and `policies` have 0.71, `bugdet` and `budget` 0.83.
"""
_LEAST_WORD = 3
"""Letters of a word that is looked for in what options say of themselves."""


_FIXED = {
    ("benchmark", "budget"): "the benchmark plays at 1% of the cells and has no --budget",
    ("benchmark", "budgets"): "the benchmark plays at 1% of the cells and has no --budgets",
}
"""What a command fixes, that others leave open, by its name and that of their option."""


def ways_on(complaint: str, options: Mapping[str, str], command: str = "") -> str:
    """What to write instead, where a complaint tells of options that are not among `options` of
    the `command`, which hold their help by name; else empty.
    """
    if not complaint.startswith(UNRECOGNIZED):
        return ""
    lacking = dict.fromkeys(re.findall(r"--([\w-]+)", complaint))
    return "".join(_way_on(name.replace("_", "-"), name, options, command) for name in lacking)


def _way_on(name: str, written: str, options: Mapping[str, str], command: str) -> str:
    if fixed := _FIXED.get((command, name)):
        return f"; {fixed}"
    if owners := [one for one in _MOST_OPTIONS if f"--{name}" in _options_of(one)]:
        told = " and ".join(f"care-sim {one}" for one in owners)
        return f"; --{written} is an option of {told}"
    if near := near_names(name, options):
        return f"; perhaps {' or '.join(near)}"
    if meant := options_about(name, options):
        return f"; {_telling(meant, name)}"
    # The one command may lack what another has: `crowding` has no weather.
    for one in _MOST_OPTIONS:
        if meant := options_about(name, _options_of(one)):
            return f"; of care-sim {one}, {_telling(meant, name)}"
    return ""


def near_names(name: str, options: Mapping[str, str]) -> list[str]:
    """The options that `name` is a part of, or nearly the name of; the likest first."""
    likeness = {one: SequenceMatcher(None, name, one.removeprefix("--")).ratio() for one in options}
    near = [one for one in options if likeness[one] >= _NEAR or _is_part(name, one)]
    return sorted(near, key=lambda one: -likeness[one])[:_MOST_TOLD]


def options_about(word: str, options: Mapping[str, str]) -> list[str]:
    """The options whose help holds the word."""
    if len(word) < _LEAST_WORD:
        return []
    found = re.compile(rf"\b{re.escape(word)}\b", re.IGNORECASE)
    # Of a flag's two names, only that which does what its help says.
    return [
        one
        for one, told in options.items()
        if found.search(told) and not (one.startswith("--no-") and f"--{one[5:]}" in options)
    ][:_MOST_TOLD]


def _is_part(name: str, option: str) -> bool:
    return len(name) >= _LEAST_WORD and f"-{name}-" in f"{option}-"


def _options_of(command: str) -> dict[str, str]:
    return option_helps(COMMANDS[command].loaded())


def _telling(names: list[str], word: str) -> str:
    return f"{' and '.join(names)} {'tells' if len(names) == 1 else 'tell'} of {word}"
