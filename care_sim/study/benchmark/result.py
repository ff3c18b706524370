"""Results of entries: what an entry reached world by world, what made it, and its file.

The score is worked out of the rows whenever a file is read; the one that stands in it is for
people. A file that cannot be so is refused in one line.
"""

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, Self

from care_sim.base.checks import LARGEST_INTEGER
from care_sim.base.errors import InvalidInput, counted, printable, shown
from care_sim.base.files import JSON, json_content, replacing
from care_sim.core.defaults import CELL_ORDERS
from care_sim.evaluation.bootstrap import Interval, mean_of_ratios
from care_sim.policies import POLICIES, maker, tags_of
from care_sim.policies.base import TAGS
from care_sim.policies.makers import check_parameters
from care_sim.study.benchmark.suite import (
    BENCHMARK_VERSION,
    CAMERAS,
    MEASURED,
    PARTS,
    SIZES,
    Entry,
    Task,
    published_worlds,
    quick_tenth,
    reached,
)
from care_sim.study.provenance import code_digest, machine, policy_digest, versions
from care_sim.study.rows.parquet import with_tuples
from care_sim.study.run_config import Row, files_in

RESULT_MARK = "care_sim_benchmark"
"""The key by which a file is known; its value is the version."""


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

    @property
    def worlds(self) -> tuple[tuple[str, int, int], ...]:
        """Part, number and reachable of the worlds that it says it was played in, in order."""
        seen = [row for row in self.rows if row.camera == MEASURED]
        return tuple((row.part, row.world, row.reachable) for row in seen)

    @property
    def uses_camera(self) -> bool:
        """Whether any play differs between the cameras; without a camera all are alike."""
        hashes: dict[tuple[str, int], set[str]] = {}
        for row in self.rows:
            hashes.setdefault((row.part, row.world), set()).add(row.hash)
        return any(len(alike) > 1 for alike in hashes.values())

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

    def lead(
        self, other: "BenchmarkResult", camera: str = MEASURED, part: str | None = None
    ) -> Interval:
        """Its score less that of another in the same worlds, in points, paired by world; of one
        `part` alone where it is given.
        """
        pairs = [
            list(zip(self.of_part(one, camera), other.of_part(one, camera), strict=True))
            for one in ([part] if part else self.parts)
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


def made_by(entry: Entry) -> dict[str, Any]:
    """What makes the results of an entry here."""
    return {"versions": versions(), **_own_code(entry), "machine": machine()}


def code_of(result: BenchmarkResult) -> str:
    """The hash of CARE-Sim's code that a result names; empty where it names none."""
    told = result.made_by.get("versions")
    return str(told.get("code", "")) if isinstance(told, dict) else ""


def processor_of(result: BenchmarkResult) -> str:
    """The processor that a result names, on one line; empty where it names none."""
    told = result.made_by.get("machine")
    named = told.get("processor") if isinstance(told, dict) else None
    return printable(named) if isinstance(named, str) else ""


def is_made_alike(result: BenchmarkResult) -> bool:
    """Whether all that a result names as its maker is here: code, policy, libraries and machine."""
    return result.made_by == made_by(result.entry)


def elsewhere(result: BenchmarkResult) -> str:
    """What made a result where that is not what is here, in words; empty where all is."""
    if is_made_alike(result):
        return ""
    by = "other libraries or another system" if is_of_this_code(result) else "other code"
    on = processor_of(result)
    return f"by {by} than here{f', on {on}' if on and on != machine()['processor'] else ''}"


def own_code_of(result: BenchmarkResult) -> str:
    """The hashes of the policy's code and files that a result names, as one text."""
    told = result.made_by
    return f"{told.get('policy_code', '')} {told.get('parameter_files', [])}"


def is_of_this_code(result: BenchmarkResult) -> bool:
    """Whether CARE-Sim and the policy, with its files, are here what made the result."""
    here = _own_code(result.entry)
    return code_of(result) == code_digest() and all(
        result.made_by.get(name) == value for name, value in here.items()
    )


def _own_code(entry: Entry) -> dict[str, Any]:
    """Hashes of the policy's own code, empty for a built-in one, and of the files that its
    parameters name.
    """
    files = files_in(entry.parameters)
    return {
        "policy_code": policy_digest(entry.policy) or "",
        **({"parameter_files": files} if files else {}),
    }


_MOST_BYTES = 2**24


def read_result(path: Path) -> BenchmarkResult:
    """The result in a file. Raises InvalidInput for a file that holds none, is of another version
    of the benchmark, or lacks worlds.
    """
    try:
        content = json_content(path, _MOST_BYTES)
    except json.JSONDecodeError as error:
        raise InvalidInput(f"{path} is cut off or no JSON: {error}") from error
    except OSError as error:
        raise InvalidInput(f"{path} cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise InvalidInput(f"{path} cannot be read: {error}") from error
    if not is_result(content):
        raise InvalidInput(f"{path} holds no result of care-sim benchmark")
    _check_version(path, content)
    try:
        result = _result(content)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise InvalidInput(f"{path} is damaged: {_reason(error)}") from error
    _check_policy(path, result)
    _check_worlds(path, result)
    return result


def _reason(error: Exception) -> str:
    """Why a file cannot be read, for people: what Python says of a type is for nobody else."""
    if isinstance(error, KeyError):
        return f"{shown(error.args[0])} is missing"
    if isinstance(error, ValueError):
        return printable(str(error))
    return "it holds values of another kind than a result does"


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
    texts = content["policy"], content["cell_order"], content.get("label", "")
    if not all(isinstance(text, str) for text in texts):
        raise ValueError("policy, cell_order and label must be texts")
    policy, order, label = texts
    entry = Entry(policy, tuple((str(name), value) for name, value in given), order, label)
    entry.check()
    if not isinstance(content["made_by"], dict):
        raise ValueError("made_by must be a table of names and values")
    return BenchmarkResult(
        entry,
        tuple(map(str, content["tags"])),
        tuple(_row(values) for values in content["rows"]),
        bool(content["quick"]),
        None if content["sealed"] is None else str(content["sealed"]),
        dict(content["made_by"]),
    )


def _row(values: Any) -> ResultRow:
    if not (isinstance(values, list) and len(values) == len(ResultRow._fields)):
        raise ValueError(f"a row must be a list of {', '.join(ResultRow._fields)}")
    row = ResultRow(*values)
    if not (isinstance(row.part, str) and isinstance(row.camera, str)):
        raise ValueError(f"a row must name its part and its camera, got {shown(values)}")
    counts = row.world, row.reached, row.reachable
    if not all(type(count) is int and 0 <= count <= LARGEST_INTEGER for count in counts):
        raise ValueError(f"a row must hold whole numbers, got {shown(values)}")
    if not (row.reachable and isinstance(row.hash, str)):
        raise ValueError(f"a row must hold something to reach and a hash, got {shown(values)}")
    if row.reached > row.reachable:
        raise ValueError(f"a row must reach at most what there is, got {shown(values)}")
    return row


def _check_policy(path: Path, result: BenchmarkResult) -> None:
    """Raise InvalidInput for unknown tags or an unknown order of cells, and for tags and parameters
    that a built-in policy does not have.
    """
    policy, tags, order = result.entry.policy, result.tags, result.entry.cell_order
    if unknown := {*tags} - {*TAGS}:
        raise InvalidInput(f"{path} has unknown tags {shown(sorted(unknown))}; known: {TAGS}")
    if order not in CELL_ORDERS:
        raise InvalidInput(
            f"{path} has the unknown cell_order {shown(order)}; known: {', '.join(CELL_ORDERS)}"
        )
    if policy not in POLICIES.built_in:
        return
    if {*tags} != {*tags_of(policy)}:
        raise InvalidInput(
            f"{path} says that {policy} is {shown(tags)}, and it is {tags_of(policy)}"
        )
    try:
        check_parameters(policy, maker(policy), dict(result.entry.parameters))
    except InvalidInput as error:
        raise InvalidInput(f"{path}: {error}") from error


def _check_worlds(path: Path, result: BenchmarkResult) -> None:
    """Raise InvalidInput unless the result is of exactly the worlds that it should be of."""
    if result.sealed is None:
        worlds = quick_tenth(published_worlds()) if result.quick else published_worlds()
        due = [(world.part, world.number, world.reachable) for world in worlds]
    else:
        # Which they are the salt alone tells; there are as many, the same under every camera, each
        # once and in the order in which the salt draws them.
        due = [*result.worlds]
        if Counter(part for part, _, _ in due) != SIZES:
            raise InvalidInput(f"{path} lacks sealed worlds: there are {SIZES}")
        for (part, number, _), (following, later, _) in pairwise(due):
            if part == following and number >= later:
                raise InvalidInput(
                    f"{path}: the numbers of sealed worlds must ascend, got {later} after {number} "
                    f"in the {part}"
                )
    expected = [
        (part, camera, number, most)
        for part in PARTS
        for camera in CAMERAS
        for own, number, most in due
        if own == part
    ]
    there = [(row.part, row.camera, row.world, row.reachable) for row in result.rows]
    if there != expected:
        version = f"version {BENCHMARK_VERSION} of the benchmark"
        missing = len({*expected} - {*there})
        # A file that has lost rows holds no others.
        wrong = (
            f"lacks {missing:,} of the {counted(len(expected), 'row')} of {version}"
            if missing and {*there} <= {*expected}
            else f"holds other worlds than {version}"
        )
        trial = " --quick" if result.quick else ""
        raise InvalidInput(
            f"{path} {wrong}: play it again with care-sim benchmark{trial} --policy "
            f"{result.entry.policy}"
        )
