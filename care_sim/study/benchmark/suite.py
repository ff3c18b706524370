"""Entries of the benchmark, and its worlds: published, drawn afresh or sealed."""

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import SystemRandom
from typing import Any

from care_sim.base.errors import InvalidInput, shown
from care_sim.base.files import (
    check_file_size,
    json_content,
    parsed_json,
    write_text,
)
from care_sim.base.plugins import is_place
from care_sim.base.seeds import FRESH, SEALED_FROM, check_secret, secret_entropy
from care_sim.core.defaults import AS_DEMANDED
from care_sim.sources.scenes import Scene, Streets
from care_sim.streets.street import street_name
from care_sim.study.episode_config import grid
from care_sim.study.play_config import play_grid
from care_sim.study.rows.parameters import Parameters
from care_sim.study.run_config import RunConfig

DRIVES, TESTS, TIGHT_TESTS, STREETS = "drives", "tests", "tight tests", "streets"
FIRST_SEED = 200
"""First test seed of the benchmark. Seeds below were looked at while the worlds were built (0 to
137 of the drives). Policies were first tried on some of them (streets 0 to 19, drives 100 to
139)."""
LATE = {"camera_latency_s": 0.12}
"""The paper's evidence is 0.11 to 0.14 s old on average."""
_EPISODES = Path(__file__).with_name("worlds.json")
_DRAWN = "fresh.json"
_SEALED_SEEDS = 2**62
_SHORTEST_SALT, _LONGEST_SALT = 32, 4096
_PACKAGED = re.compile(r"\w[\w.-]*")
"""The form of a policy's name that is no MODULE:OBJECT."""
_LONGEST_NAME = 120
BOUNDS_MODULE = "care_sim.study.benchmark.bounds:"
"""The module of the policies that know the truth; the benchmark plays none for anybody."""
_UNTABLED = "|<>$`"
"""Characters that tables, pages and figures take for more than text."""
_DRAWN_TEST = ("ncap", (("test", "drawn"), ("speed_kph", 0)))
_SCENARIOS: dict[str, tuple[str, Parameters]] = {
    DRIVES: ("drive", ()),
    TESTS: _DRAWN_TEST,
    TIGHT_TESTS: _DRAWN_TEST,
}


@dataclass(frozen=True)
class Entry:
    """A policy with its parameters, and the order of the cells in its sets; the `label` is the name
    that its authors give it.
    """

    policy: str
    parameters: Parameters = ()
    cell_order: str = AS_DEMANDED
    label: str = ""

    @property
    def name(self) -> str:
        """The name in a table, with the names of files and not their folders."""
        # The label of a bound says what it knows, and the place of its code nothing more.
        if self.label and self.policy.startswith(BOUNDS_MODULE):
            return self.label
        played = self._text([(name, _file_name(value)) for name, value in self.parameters])
        return f"{self.label} ({played})" if self.label else played

    @property
    def full_name(self) -> str:
        """The name that no other entry has."""
        return " ".join([self.label, self._text(self.parameters)]).strip()

    def check(self) -> None:
        """Raise InvalidInput for names that a table cannot hold, or that no policy can have."""
        if not (_PACKAGED.fullmatch(self.policy) or is_place(self.policy)):
            raise InvalidInput(
                f"the policy must be a name of letters, digits, . and -, or MODULE:OBJECT, got "
                f"{shown(self.policy)}"
            )
        name = self.name
        if not (len(name) <= _LONGEST_NAME and name.isprintable()) or {*name} & {*_UNTABLED}:
            raise InvalidInput(
                f"the name of an entry must be printable, at most {_LONGEST_NAME} characters and "
                f"without {' '.join(_UNTABLED)}, got {shown(name)}"
            )

    def _text(self, parameters: Sequence[tuple[str, Any]]) -> str:
        given = [f"{name}={value}" for name, value in parameters]
        order = [self.cell_order] if self.cell_order != AS_DEMANDED else []
        return " ".join([self.policy, *given, *order])

    @property
    def conditions(self) -> dict[str, Any]:
        """The arguments of a configuration."""
        return {"policy_parameters": self.parameters, "cell_order": self.cell_order}


def _file_name(value: Any) -> Any:
    """Return the last part of a path of any system, and any other value as it is."""
    if isinstance(value, tuple):
        return tuple(map(_file_name, value))
    return re.split(r"[/\\]", value.rstrip("/\\"))[-1] if isinstance(value, str) else value


@dataclass(frozen=True)
class Salt:
    """A secret text that draws the seeds of a sealed set; results carry its `digest` alone."""

    text: str
    digest: str

    @classmethod
    def read(cls, path: Path) -> "Salt":
        """Read the salt of a file; its digest is what `sha256sum` prints of the file.

        Raises InvalidInput for a file that cannot be read or holds no salt.
        """
        make = 'python -c "import secrets; print(secrets.token_hex())"'
        try:
            check_file_size(path, _LONGEST_SALT)
            content = path.read_bytes()
            text = content.decode("ascii").strip()
        except (OSError, ValueError) as error:
            raise InvalidInput(f"{path} holds no salt ({error}); {make} prints one") from error
        if len(text) < _SHORTEST_SALT:
            raise InvalidInput(
                f"the salt in {path} must have {_SHORTEST_SALT} characters or more, got "
                f"{len(text)}; {make} prints one"
            )
        check_secret(text)
        return cls(text, hashlib.sha256(content).hexdigest())

    def seed(self, part: str, number: int) -> int:
        """Return the seed of a world, beyond every split and every fresh draw."""
        drawn = secret_entropy(f"benchmark {part}", (number,), self.text)
        return SEALED_FROM + drawn % _SEALED_SEEDS


def fresh_seeds(folder: Path, number: int) -> list[int]:
    """Draw seeds that nobody has played, by lot from `FRESH`; the folder keeps the draw, so that
    the same command meets the same worlds. Raises InvalidInput for a damaged draw.
    """
    path = folder / _DRAWN
    try:
        seeds = json_content(path) if path.exists() else []
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{path} cannot be read: {error}") from error
    is_list = isinstance(seeds, list) and all(type(each) is int for each in seeds)
    if not (is_list and all(each in FRESH for each in seeds) and len({*seeds}) == len(seeds)):
        raise InvalidInput(
            f"{path} is damaged: it must list different seeds of {FRESH[0]} to {FRESH[-1]}"
        )
    if len(seeds) < number:
        further = SystemRandom().sample(FRESH, number)
        seeds = [*seeds, *(each for each in further if each not in seeds)][:number]
        write_text(path, f"{json.dumps(seeds)}\n")
    return seeds[:number]


@cache
def episode_seeds(part: str) -> tuple[int, ...]:
    """Return the seeds of the drives or tests: the first ones from `FIRST_SEED` on in which a car
    that detects nothing collides and the full scan does not. Tight tests are
    those in which the full scan only just avoids the collision (`tests/helpers/tight_tests.py`).
    No policy was played on these seeds to choose them.
    """
    return tuple(map(int, _listed(part)))


def _listed(part: str) -> Any:
    return parsed_json(_EPISODES.read_text(encoding="utf-8"))[part]


@cache
def tight_reactions() -> dict[int, float]:
    """Return the brake's reaction of every tight test by seed, in seconds."""
    return {int(seed): reaction_s for seed, reaction_s in _listed(TIGHT_TESTS).items()}


def configurations(
    part: str, seeds: Sequence[int], policy: str, budget: float = 1.0, **conditions: Any
) -> Sequence[RunConfig]:
    """Return a configuration per seed of a part, in their order. Raises InvalidInput as the
    configurations do.
    """
    if part == STREETS:
        scenes = [Scene(street_name(seed), seed) for seed in seeds]
        return play_grid(Streets(), scenes, [policy], [budget], **conditions)
    scenario, parameters = _SCENARIOS[part]
    plays = grid(
        [scenario], [policy], [budget], seeds, scenario_parameters=parameters, **conditions
    )
    if part != TIGHT_TESTS:
        return plays
    reactions = tight_reactions()
    return [play.changed(brake_reaction_s=reactions[play.seed]) for play in plays]
