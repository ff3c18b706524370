"""The result of an entry: what it reached world by world, and what made it. Its file is read by
`care_sim.study.benchmark.result_file`.

The score is worked out of the rows whenever a file is read; the one that stands in it is for
people.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, Self

from care_sim.base.errors import printable
from care_sim.base.files import JSON, replacing
from care_sim.evaluation.bootstrap import Interval, mean_of_ratios
from care_sim.study.benchmark.suite import (
    BENCHMARK_VERSION,
    CAMERAS,
    MEASURED,
    Entry,
    Task,
    quick_tenth,
    reached,
)
from care_sim.study.provenance import code_digest, machine, policy_digest, versions
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
