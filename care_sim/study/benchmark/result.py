"""The result file of an entry: what it reached world by world, and what made it.

The score is worked out of the rows whenever a file is read; the one that stands in it is for
people.
"""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, Self

from care_sim.base.checks import is_number
from care_sim.base.errors import InvalidInput, shown
from care_sim.base.files import JSON, replacing
from care_sim.base.json_text import json_content
from care_sim.evaluation.bootstrap import Interval, mean_of_ratios
from care_sim.study.benchmark.tasks import CAMERAS, MEASURED, Entry, Task, reached
from care_sim.study.benchmark.worlds import (
    BENCHMARK_VERSION,
    PARTS,
    SIZES,
    published_worlds,
    quick_tenth,
)
from care_sim.study.rows.parquet import with_tuples
from care_sim.study.run_config import Row

RESULT_MARK = "care_sim_benchmark"
"""The key by which a file is known; its value is the version."""
_MOST_BYTES = 2**24


class ResultRow(NamedTuple):
    """What was reached in a world under a camera, of what there is to reach; `hash` is that of the
    episode.
    """

    part: str
    camera: str
    world: int
    reached: int
    reachable: int
    hash: str

    @classmethod
    def of(cls, task: Task, row: Row) -> Self:
        """That of a play."""
        world = task.world
        got = reached(world.part, row)
        return cls(world.part, task.camera, world.number, got, world.reachable, row["episode_hash"])


@dataclass(frozen=True)
class BenchmarkResult:
    """What an entry reached. `quick` of a tenth of the worlds; `sealed` is the digest of the salt
    that drew them, None of the published ones. `made_by` are versions and machine.
    """

    entry: Entry
    tags: tuple[str, ...]
    rows: tuple[ResultRow, ...]
    quick: bool
    sealed: str | None
    made_by: Mapping[str, Any]

    @property
    def parts(self) -> list[str]:
        """The parts of the benchmark that its rows are of: all, where it is whole."""
        return [*dict.fromkeys(row.part for row in self.rows)]

    def of_part(self, part: str, camera: str) -> list[ResultRow]:
        """Its rows, in the order of their worlds."""
        return [row for row in self.rows if (row.part, row.camera) == (part, camera)]

    def part_score(self, part: str, camera: str = MEASURED) -> float:
        """Of what a full scan reaches, the share that the entry reached, in percent."""
        rows = self.of_part(part, camera)
        return 100 * sum(row.reached for row in rows) / sum(row.reachable for row in rows)

    def score(self, camera: str = MEASURED) -> Interval:
        """The mean of the parts, in percent; worlds are drawn for its interval."""
        return mean_of_ratios(
            [
                ([100 * row.reached for row in rows], [row.reachable for row in rows])
                for rows in (self.of_part(part, camera) for part in self.parts)
            ]
        )

    def lead(self, other: "BenchmarkResult", camera: str = MEASURED) -> Interval:
        """Its score less that of another in the same worlds, in points, paired by world."""
        pairs = [
            list(zip(self.of_part(part, camera), other.of_part(part, camera), strict=True))
            for part in self.parts
        ]
        return mean_of_ratios(
            [
                ([100 * (a.reached - b.reached) for a, b in own], [a.reachable for a, _ in own])
                for own in pairs
            ]
        )

    def cut_to_tenth(self) -> "BenchmarkResult":
        """What it reached in the worlds of `--quick`."""
        if self.quick:
            return self
        first = quick_tenth([row for row in self.rows if row.camera == MEASURED])
        kept = {(row.part, row.world) for row in first}
        rows = tuple(row for row in self.rows if (row.part, row.world) in kept)
        return replace(self, rows=rows, quick=True)

    def write(self, path: Path) -> None:
        """Write it, a row a line."""
        head = {
            RESULT_MARK: BENCHMARK_VERSION,
            "entry": self.entry.name,
            "score": {camera: self._told(camera) for camera in CAMERAS},
            **asdict(self.entry),
            "tags": self.tags,
            "quick": self.quick,
            "sealed": self.sealed,
            "made_by": self.made_by,
            "columns": ResultRow._fields,
        }
        rows = ",\n  ".join(json.dumps(row) for row in self.rows)
        opened = json.dumps(head, indent=1).removesuffix("\n}")
        with replacing(path, JSON) as unfinished:
            unfinished.write_text(f'{opened},\n "rows": [\n  {rows}\n ]\n}}\n', encoding="utf-8")

    def _told(self, camera: str) -> dict[str, Any]:
        mean, low, high = (round(value, 2) for value in self.score(camera))
        parts = {part: round(self.part_score(part, camera), 2) for part in self.parts}
        return {"score": mean, "interval": [low, high], **parts}


def read_result(path: Path) -> BenchmarkResult:
    """The result in a file. Raises InvalidInput for a file that holds none, is of another version
    of the benchmark, or lacks worlds.
    """
    try:
        content = json_content(path, _MOST_BYTES)
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{path} cannot be read: {error}") from error
    if not is_result(content):
        raise InvalidInput(f"{path} holds no result of care-sim benchmark")
    _check_version(path, content)
    try:
        result = _result(content)
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidInput(
            f"{path} is damaged: {type(error).__name__} {shown(str(error))}"
        ) from error
    _check_worlds(path, result)
    return result


def is_result(content: object) -> bool:
    """Whether a file of this content is meant as a result."""
    return isinstance(content, dict) and RESULT_MARK in content


def _check_version(path: Path, content: Mapping[str, Any]) -> None:
    version = content[RESULT_MARK]
    if version != BENCHMARK_VERSION:
        raise InvalidInput(
            f"{path} is of version {shown(version)} of the benchmark, this care-sim scores version "
            f"{BENCHMARK_VERSION}: play it again with care-sim benchmark --policy "
            f"{content.get('policy', 'NAME')}"
        )


def _result(content: Mapping[str, Any]) -> BenchmarkResult:
    """The result as it is told. Raises KeyError, TypeError or ValueError where it is damaged."""
    if content["columns"] != list(ResultRow._fields):
        raise ValueError("its columns are others")
    given = with_tuples({"given": content["parameters"]})["given"]
    texts = content["policy"], content["cell_order"]
    if not all(isinstance(text, str) for text in texts):
        raise TypeError("policy and cell_order must be texts")
    return BenchmarkResult(
        Entry(texts[0], tuple((str(name), value) for name, value in given), texts[1]),
        tuple(map(str, content["tags"])),
        tuple(_row(values) for values in content["rows"]),
        bool(content["quick"]),
        None if content["sealed"] is None else str(content["sealed"]),
        dict(content["made_by"]),
    )


def _row(values: Sequence[Any]) -> ResultRow:
    row = ResultRow(*values)
    counts = row.world, row.reached, row.reachable
    if not all(is_number(count) and count == int(count) >= 0 for count in counts):
        raise ValueError(f"a row must hold whole numbers, got {shown(values)}")
    if not (row.reachable and isinstance(row.hash, str)):
        raise ValueError(f"a row must hold something to reach and a hash, got {shown(values)}")
    return row


def _check_worlds(path: Path, result: BenchmarkResult) -> None:
    """Raise InvalidInput unless the result is of exactly the worlds that it should be of."""
    if result.sealed is None:
        worlds = quick_tenth(published_worlds()) if result.quick else published_worlds()
        due = [(world.part, world.number, world.reachable) for world in worlds]
    else:
        # Which they are the salt alone tells; there are as many, the same under every camera.
        seen = [row for row in result.rows if row.camera == MEASURED]
        due = [(row.part, row.world, row.reachable) for row in seen]
        if Counter(row.part for row in seen) != SIZES:
            raise InvalidInput(f"{path} lacks sealed worlds: there are {SIZES}")
    expected = [
        (part, camera, number, most)
        for part in PARTS
        for camera in CAMERAS
        for own, number, most in due
        if own == part
    ]
    there = [(row.part, row.camera, row.world, row.reachable) for row in result.rows]
    if there != expected:
        raise InvalidInput(
            f"{path} holds other worlds than version {BENCHMARK_VERSION} of the benchmark: play it "
            f"again with care-sim benchmark --policy {result.entry.policy}"
        )
