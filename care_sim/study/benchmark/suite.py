"""Worlds and tasks of the benchmark: published worlds, and those that a secret salt seals.

Only worlds count in which sensing decides something (`care_sim.study.benchmark.play`). They were
found with a car that detects nothing and with the full scan, before any policy played them.
"""

import hashlib
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from care_sim.base.errors import InvalidInput, shown
from care_sim.base.files import check_file_size, parsed_json, write_text
from care_sim.base.plugins import is_place
from care_sim.base.seeds import check_secret, secret_entropy
from care_sim.core.conditions import YOLOX_CAMERA
from care_sim.core.defaults import AS_DEMANDED
from care_sim.sources.scenes import Scene, Streets
from care_sim.streets.street import street_name
from care_sim.study.episode_config import grid
from care_sim.study.play_config import play_grid
from care_sim.study.rows.parameters import Parameters
from care_sim.study.rows.reading import is_avoided
from care_sim.study.run_config import Row, RunConfig

BENCHMARK_VERSION = 1
"""Of worlds, conditions and scorer together. Whatever changes a published row makes another one."""

DRIVES, TESTS, STREETS = PARTS = ("drives", "tests", "streets")
SIZES = {DRIVES: 80, TESTS: 120, STREETS: 40}
"""Worlds of every part. By chance alone the share of 80 drives is known to 6 points (its standard
error at most), that of 120 tests to 5, and that of 40 streets, with ten sightings each, to 3 or 4:
the mean of the three parts to 3."""
FIRST_SEED = 200
"""The test seeds below it were looked at while the worlds were built (0 to 137 of the drives), and
policies were first tried on some of them (streets 0 to 19, drives 100 to 139)."""
QUICK_SHARE = 10
"""One world in so many is played by `--quick`: the first of every part."""


_PUBLISHED = Path(__file__).with_name("worlds.json")
_SEALED_FROM = 2**32
"""Sealed seeds lie above every split: no policy was trained or chosen on them."""
_SEALED_SEEDS = 2**62
_SHORTEST_SALT = 32
_LONGEST_SALT = 4096


class World(NamedTuple):
    """A world by its part and number. `reachable` is what a full scan reaches in it: one collision
    avoided, or so many first sightings.
    """

    part: str
    number: int
    seed: int
    reachable: int


@dataclass(frozen=True)
class Salt:
    """A secret text that draws the seeds of a sealed set; `digest` is what is published of it."""

    text: str
    digest: str

    @classmethod
    def read(cls, path: Path) -> "Salt":
        """That of a file; its digest is what `sha256sum` prints of the file.

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
        """The seed of a candidate."""
        drawn = secret_entropy(f"benchmark {part}", (number,), self.text)
        return _SEALED_FROM + drawn % _SEALED_SEEDS


def candidates(part: str, salt: Salt | None) -> Iterator[tuple[int, int]]:
    """Numbers and seeds of the worlds of a part that are looked at in turn, without end."""
    for n in count():
        number = n if salt else FIRST_SEED + n
        yield number, salt.seed(part, n) if salt else number


@cache
def published_worlds() -> tuple[World, ...]:
    """The worlds that everybody plays, part by part."""
    listed = parsed_json(_PUBLISHED.read_text(encoding="utf-8"))
    return tuple(World(part, seed, seed, most) for part in PARTS for seed, most in listed[part])


def publish_worlds(worlds: Sequence[World]) -> None:
    """For maintainers: make these the worlds that everybody plays."""
    parts = (
        f' "{part}": {json.dumps([[w.seed, w.reachable] for w in worlds if w.part == part])}'
        for part in PARTS
    )
    write_text(_PUBLISHED, "{\n" + ",\n".join(parts) + "\n}\n")


def quick_tenth(things: Sequence[Any]) -> list[Any]:
    """The first tenth of every part, of worlds or of what has been reached in them."""
    by_part = [[thing for thing in things if thing.part == part] for part in PARTS]
    return [thing for own in by_part for thing in own[: -(-len(own) // QUICK_SHARE)]]


BENCHMARK_BUDGET = 0.01
"""Share of the cells: 164 of 16,384. With 2 and 3% a map without a camera is nearly as good in the
closed loop (`results/data/validate-drive`, `results/data/validate-ncap`)."""
MEASURED, IDEAL = CAMERAS = ("measured", "ideal")
BLIND = "blind"
"""A camera that misses everything and makes no false box: no part of the suite, it tells how much
of a score is the camera's."""
_YOLOX = {"camera_profile": YOLOX_CAMERA}
LATE = {"camera_latency_s": 0.12}
"""The paper's evidence is 0.11 to 0.14 s old on average."""
_PACKAGED = re.compile(r"\w[\w.-]*")
"""The form of a policy's name that is no MODULE:OBJECT."""
_LONGEST_NAME = 120
_UNTABLED = "|<>$`"
"""What tables, pages and figures take for more than text."""
_SCENARIOS: dict[str, tuple[str, Parameters]] = {
    DRIVES: ("drive", ()),
    TESTS: ("ncap", (("test", "drawn"), ("speed_kph", 0))),
}


@dataclass(frozen=True)
class Entry:
    """What takes part: a policy with its parameters, and the order of the cells in its sets; the
    `label` is what its people call it.
    """

    policy: str
    parameters: Parameters = ()
    cell_order: str = AS_DEMANDED
    label: str = ""

    @property
    def name(self) -> str:
        """What its line in a table begins with: of files the names alone, not where they lie."""
        played = self._told([(name, _file_name(value)) for name, value in self.parameters])
        return f"{self.label} ({played})" if self.label else played

    @property
    def full_name(self) -> str:
        """What tells it from every other entry."""
        return " ".join([self.label, self._told(self.parameters)]).strip()

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

    def _told(self, parameters: Sequence[tuple[str, Any]]) -> str:
        given = [f"{name}={value}" for name, value in parameters]
        order = [self.cell_order] if self.cell_order != AS_DEMANDED else []
        return " ".join([self.policy, *given, *order])

    @property
    def conditions(self) -> dict[str, Any]:
        """As arguments of a configuration."""
        return {"policy_parameters": self.parameters, "cell_order": self.cell_order}


class Task(NamedTuple):
    """A world under a camera, and the configuration that plays it."""

    world: World
    camera: str
    config: RunConfig


def camera_conditions(part: str, camera: str) -> dict[str, Any]:
    """The camera as conditions. A film has a picture every 0.5 s and none that is 0.12 s old, so
    that on streets the measured camera is not late.
    """
    if camera == BLIND:
        return {"false_negative_rate": 1.0}
    if camera == IDEAL:
        return {}
    return _YOLOX if part == STREETS else _YOLOX | LATE


def configurations(
    part: str,
    seeds: Sequence[int],
    policy: str,
    budget: float = BENCHMARK_BUDGET,
    **conditions: Any,
) -> Sequence[RunConfig]:
    """One for each seed of a part, in their order. Raises InvalidInput as the configurations do."""
    if part == STREETS:
        scenes = [Scene(street_name(seed), seed) for seed in seeds]
        return play_grid(Streets(), scenes, [policy], [budget], **conditions)
    scenario, parameters = _SCENARIOS[part]
    return grid(
        [scenario],
        [policy],
        [budget],
        seeds,
        scenario_parameters=parameters,
        **conditions,
    )


def tasks_of(entry: Entry, worlds: Sequence[World], cameras: Sequence[str] = CAMERAS) -> list[Task]:
    """An entry in every world under every camera. Raises InvalidInput for one that cannot be
    played in both loops.
    """
    tasks = []
    for part in dict.fromkeys(world.part for world in worlds):
        own = [world for world in worlds if world.part == part]
        for camera in cameras:
            given = camera_conditions(part, camera) | entry.conditions
            configs = configurations(part, [w.seed for w in own], entry.policy, **given)
            tasks += [
                Task(world, camera, config) for world, config in zip(own, configs, strict=True)
            ]
    return tasks


def _file_name(value: Any) -> Any:
    """The last part of a path, of either kind of system; any other value as it is."""
    if isinstance(value, tuple):
        return tuple(map(_file_name, value))
    return re.split(r"[/\\]", value.rstrip("/\\"))[-1] if isinstance(value, str) else value


def reached(part: str, row: Row) -> int:
    """What of the reachable a play reached: a collision avoided, or first sightings found."""
    return int(row["sighted"]) if part == STREETS else int(is_avoided(row))
