"""Command lines from the program's own commands: their options, by name and type, and values that
fit or do not.
"""

import typing
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import UnionType

from tests.torture import hostile
from tests.torture.case import words

PIECES = [
    *words("dartout dense cutin care history full all-camera ppo learned-scorer random all fast"),
    *words("bullet returns cluster pillars torchscript streets evaluation calibration val"),
    *words("street-0000 CARE-Dense-v0 CARE-Street-v0 SectorScores 0.03 0.1 1 2 3 0 0.5 31"),
]
"""Values that fit somewhere."""
PATHS = [
    *words("out out/deep/er results results/episodes.parquet results/config.json"),
    *words("results/journal.jsonl empty text text/under none link loop broken-link null zero"),
    *words("full pipe locked x.png x.gif x.webp x.mp4 x.rrd x.html x.npz x.json x. .x x.PNG"),
    *words("ü.png . .. -x /proc/self/nothing/out"),
    *("", "a b.png", "\udcff.png", "n" * 300, "x\x00y", "\x1b[31m.png"),
]
CLUSTERS = [
    *words("nonsense ucx://x tls://x tcp:// x://y inproc://x : tcp://127.0.0.1:99999"),
    *("", "a b", "\n"),
]
SOURCES = [
    *words("streets argoverse2:drive nuscenes:base argoverse2:none nuscenes:empty argoverse2:"),
    *(":", "nuscenes", "argoverse2:text", "nuscenes:\x00"),
]
WORK = {
    *words("seeds scenes fresh episodes steps repeats samples resets seconds floor_seeds"),
    *words("evaluate_every environments rollout epochs batch memory"),
}
"""Options that say how much is to be done; a large value honestly takes its time."""
TINY = dict.fromkeys(
    words("workers seeds scenes floor_seeds repeats samples resets environments"), "1"
)
TINY |= {"episodes": "0", "episode": "0", "steps": "64", "evaluate_every": "64"}
TINY |= {"seconds": "0.01", "rollout": "8", "scenario_parameters": "duration_s=0.2"}
LONG = {
    *words("reproduce sweep protocol study judge certify benchmark leaderboard train"),
    *words("report export"),
}
"""Commands that may take their time."""


def commands():
    """Every command line that can begin, with the dataclass of its options."""
    from care_sim.commands.table import COMMANDS

    return {tuple(name.split()): command.options_class() for name, command in COMMANDS.items()}


def options(kind):
    """The options of a command: name, type and whether it is given without a name."""
    hints = typing.get_type_hints(kind, include_extras=True)
    for field in fields(kind):
        hint, marks = hints[field.name], ()
        if typing.get_origin(hint) is typing.Annotated:
            hint, *marks = typing.get_args(hint)
        if is_dataclass(hint):
            yield from options(hint)
        else:
            yield (
                field.name,
                hint,
                any("Positional" in repr(mark) for mark in marks),
                field.default is MISSING,
            )


class Grammar:
    """Draws command lines; `long` says that the last one may honestly take long."""

    def __init__(self, rng):
        self._rng = rng
        self.long = False

    def line(self):
        """Arguments of `care-sim`."""
        rng = self._rng
        if rng.random() < 0.03:
            return [self._text() for _ in range(rng.randrange(4))]
        first, kind = rng.choice([*commands().items()])
        self.long = first[0] in LONG
        known, share = [*options(kind)], 2.5
        given = [one for one in known if one[2] or one[3] or rng.random() < share / len(known)]
        names = {one[0] for one in known} - {one[0] for one in given}
        tiny = {name: TINY[name] for name in sorted(names & {*TINY}) if rng.random() < 0.97}
        line = [*first, *(piece for one in given for piece in self._option(*one))]
        line += [piece for name, value in tiny.items() for piece in (_flag(name), value)]
        return self._spoilt(line) if rng.random() < 0.05 else line

    def _option(self, name, hint, positional, _needed):
        rng, values = self._rng, self._values(name, hint)
        if hint is bool:
            return [_flag(name) if rng.random() < 0.5 else f"--no-{name.replace('_', '-')}"]
        if positional:
            return values
        if rng.random() < 0.05:
            return [f"{_flag(name)}={value}" for value in values[:1]]
        return [_flag(name), *values]

    def _values(self, name, hint):
        """One value, several or none, as the option's type has it; now and then not."""
        if typing.get_origin(hint) is tuple:
            inner, count = typing.get_args(hint)[0], self._rng.choice((0, 1, 1, 1, 2, 3))
        else:
            inner, count = hint, 1 + (self._rng.random() < 0.03)
        return [self._value(name, inner) for _ in range(count)]

    def _value(self, name, hint):
        rng = self._rng
        if name == "cluster":
            return rng.choice(CLUSTERS)
        if name.endswith("_parameters"):
            return self._parameter(name)
        roll = rng.random()
        if roll < 0.16:
            return self._text() if roll < 0.08 else self._number(name)
        if _is(hint, Path):
            return rng.choice(PATHS)
        if _is(hint, int) or _is(hint, float):
            fitting = ("0", "1", "2", "3", "0.5", "0.1", "1.0", "16", TINY.get(name, "1"))
            return self._number(name) if roll < 0.5 else rng.choice(fitting)
        return rng.choice(SOURCES if name == "source" else (*self._names(name), *PIECES))

    def _names(self, name):
        """Values that fit an option of this name; thrice, so that they are drawn more often."""
        from care_sim.core.conditions import DRIVERS
        from care_sim.core.defaults import CELL_ORDERS
        from care_sim.core.firing.listing import HARDWARE
        from care_sim.policies import policy_names
        from care_sim.scenarios import SCENARIOS

        names = {"scenario": [*SCENARIOS], "scenarios": [*SCENARIOS, "all"]}
        names |= {"policy": policy_names(), "policies": [*policy_names(), "all"]}
        names |= {"engine": ["fast", "bullet"], "cell_order": [*CELL_ORDERS], "driver": [*DRIVERS]}
        return (names | {"firing": [*HARDWARE, "tiles:2x16"]}).get(name, []) * 6

    def _parameter(self, option):
        """NAME=VALUE, or something like it."""
        rng = self._rng
        if rng.random() < 0.1:
            return self._text()
        name = rng.choice(_parameter_names(option))
        value = rng.choice(
            (*hostile.LITERALS, *hostile.NUMBERS, *hostile.NUMBERS, *hostile.TEXTS, *PIECES, *PATHS)
        )
        if name in ("duration_s", "vehicles"):
            self.long = True
        return f"{name}={value}"

    def _number(self, name):
        self.long |= name in WORK
        return self._rng.choice(hostile.NUMBERS)

    def _text(self):
        return self._rng.choice((*hostile.TEXTS, *hostile.LITERALS))

    def _spoilt(self, line):
        """Words doubled, dropped, swapped or cut."""
        rng, line = self._rng, list(line)
        at = rng.randrange(len(line))
        change = rng.randrange(4)
        if change == 0:
            line.insert(at, line[at])
        elif change == 1:
            del line[at]
        elif change == 2:
            other = rng.randrange(len(line))
            line[at], line[other] = line[other], line[at]
        else:
            line[at] = line[at][: rng.randrange(len(line[at]) + 1)]
        self.long = True
        return line


def is_safe(line):
    """Whether what it writes stays where the case is: no absolute path but those of `PATHS`."""
    pieces = (part for argument in line for part in argument.split("=", 1))
    return all(
        not part.lstrip().startswith(("/", "~")) or part in PATHS
        for whole in pieces
        for part in whole.split(":", 1)
    )


def _flag(name):
    return f"--{name.replace('_', '-')}"


def _is(hint, kind):
    return hint is kind or (isinstance(hint, UnionType) and kind in typing.get_args(hint))


def _parameter_names(option):
    """Parameters that there are, of scenarios, policies and detectors."""
    from care_sim.policies import BUILT_IN, maker
    from care_sim.policies.listing import parameter_texts
    from care_sim.scenarios import SCENARIOS

    if option in ("scenario_parameters", "env_parameters"):
        names = [field.name for scenario in SCENARIOS.values() for field in fields(scenario)]
        more = "budget keyframe_s render_mode detector source reward_weights floor self"
        return [*names, *words(more)]
    if option == "detector_parameters":
        return words("file min_returns grid x self")
    names = [text.partition("=")[0] for name in BUILT_IN for text in parameter_texts(maker(name))]
    more = "path ppo.path learned-scorer.path learned-sets.path none.x rig"
    return [*names, *(f"care-sbf.{name}" for name in names), *words(more)]
