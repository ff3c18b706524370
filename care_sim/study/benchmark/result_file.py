"""The result file of an entry is read, and checked: what cannot be so is refused in one line."""

import json
from collections import Counter
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from care_sim.base.checks import LARGEST_INTEGER
from care_sim.base.errors import InvalidInput, counted, printable, shown
from care_sim.base.json_text import json_content
from care_sim.core.defaults import CELL_ORDERS
from care_sim.policies import POLICIES, maker, tags_of
from care_sim.policies.base import TAGS
from care_sim.policies.makers import check_parameters
from care_sim.study.benchmark.result import RESULT_MARK, BenchmarkResult, ResultRow
from care_sim.study.benchmark.suite import (
    BENCHMARK_VERSION,
    CAMERAS,
    PARTS,
    SIZES,
    Entry,
    published_worlds,
    quick_tenth,
)
from care_sim.study.rows.parquet import with_tuples

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
