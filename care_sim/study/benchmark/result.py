"""Result files of the benchmark: read, checked, and the published ones.

The score is computed from the rows whenever a file is read; the score in the file is for people.
"""

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from care_sim.base.errors import InvalidInput, counted, printable, shown
from care_sim.base.files import json_content, parsed_json, write_text
from care_sim.base.seeds import FRESH
from care_sim.core.defaults import CELL_ORDERS
from care_sim.evaluation.smallest_budget import BUDGETS
from care_sim.policies import POLICIES, maker, tags_of
from care_sim.policies.base import TAGS
from care_sim.policies.makers import check_parameters
from care_sim.study.benchmark.budgets import (
    BUDGET_MARK,
    BUDGET_VERSION,
    COUNTS,
    MAIN_DETECTOR,
    BudgetResult,
    BudgetRow,
    budget_worlds,
)
from care_sim.study.benchmark.recorded import RECORDED_PARTS, part_of, source_of_world
from care_sim.study.benchmark.suite import STREETS, Entry
from care_sim.study.rows.parquet import with_tuples

_REFERENCES = Path(__file__).with_name("references")
"""The folder of the published entries, with a file per detector."""
_MOST_BYTES = 2**24


def read_result(path: Path) -> BudgetResult:
    """Read the result in a file. Raises InvalidInput for a file that holds none, is damaged, or is
    of other budgets, counts or worlds than this version's.
    """
    result = result_of(_content(path), str(path))
    try:
        _check_published(result)
    except InvalidInput as error:
        raise InvalidInput(f"{path} {error}") from error
    return result


def is_result(path: Path) -> bool:
    """Return whether a file is meant as a result; a file that cannot be read may have been one."""
    try:
        content = _content(path)
    except InvalidInput:
        return True
    return isinstance(content, dict) and BUDGET_MARK in content


def _content(path: Path) -> Any:
    try:
        return json_content(path, _MOST_BYTES)
    except (OSError, ValueError) as error:
        reason = printable(getattr(error, "strerror", None) or str(error))
        raise InvalidInput(f"{path} cannot be read: {reason}") from error


def result_of(content: Any, origin: str) -> BudgetResult:
    """Return the result that parsed JSON holds; `origin` names its place. Raises InvalidInput."""
    if not isinstance(content, dict) or BUDGET_MARK not in content:
        raise InvalidInput(f"{origin} holds no result of care-sim benchmark")
    if content[BUDGET_MARK] != BUDGET_VERSION:
        raise InvalidInput(
            f"{origin} is of version {shown(content[BUDGET_MARK])} of the benchmark, and this is "
            f"version {BUDGET_VERSION}: play it again"
        )
    try:
        result = _parsed(content)
    except KeyError as error:
        raise InvalidInput(f"{origin} is damaged: {shown(error.args[0])} is missing") from error
    except (InvalidInput, ValueError) as error:
        raise InvalidInput(f"{origin} is damaged: {printable(str(error))}") from error
    except (TypeError, OverflowError) as error:
        # Python's own words about types help nobody.
        raise InvalidInput(f"{origin} is damaged: it holds values of another kind") from error
    for check in (_check_policy, _check_worlds):
        try:
            check(result)
        except InvalidInput as error:
            raise InvalidInput(f"{origin} {error}") from error
    return result


def _parsed(content: Mapping[str, Any]) -> BudgetResult:
    """Return the result. Raises KeyError, TypeError, ValueError or InvalidInput where damaged."""
    if content["columns"] != list(BudgetRow._fields) or content["budgets"] != list(BUDGETS):
        raise ValueError(f"its budgets must be {BUDGETS}, its columns {BudgetRow._fields}")
    given, looking = (
        tuple((str(name), value) for name, value in with_tuples({"given": pairs})["given"])
        for pairs in (content["parameters"], content.get("detector_parameters", []))
    )
    texts = content["policy"], content["cell_order"], content["label"], content["detector"]
    if not all(isinstance(text, str) for text in texts):
        raise ValueError("policy, cell_order, label and detector must be texts")
    policy, order, label, detector = texts
    entry = Entry(policy, given, order, label)
    entry.check()
    rows = tuple(_row(*values) for values in content["rows"])
    counts = content["counts"]
    if not isinstance(counts, dict):
        raise ValueError("its counts must be lists by part")
    for part in dict.fromkeys(row.part for row in rows):
        if counts.get(part) != list(COUNTS.get(part, ())):
            raise ValueError(f"its counts of {shown(part)} must be {COUNTS.get(part, ())}")
    sealed = content.get("sealed")
    result = BudgetResult(
        entry,
        tuple(map(str, content["tags"])),
        detector,
        rows,
        bool(content["quick"]),
        dict(content["made_by"]),
        None if sealed is None else str(sealed),
        tuple(map(float, content.get("policy_ms", ()))),
        looking,
    )
    # The shapes and numbers of rows are checked where their counts are made.
    if not result.counts:
        raise ValueError("it has no rows")
    return result


def _row(part: Any, world: Any, full: Any, got: Any) -> BudgetRow:
    if type(world) is not (str if part in RECORDED_PARTS else int):
        raise ValueError("a row must name its part, and its world by a seed or a drive")
    if part in RECORDED_PARTS and part != (due := part_of(source_of_world(world))):
        raise ValueError(f"the drive {shown(world)} is of the part {due}, not of {part}")
    return BudgetRow(part, world, tuple(full), tuple(map(tuple, got)))


def _check_policy(result: BudgetResult) -> None:
    """Raise InvalidInput for unknown tags or an unknown order of cells, and for tags and parameters
    that a built-in policy does not have.
    """
    policy, tags, order = result.entry.policy, result.tags, result.entry.cell_order
    if unknown := {*tags} - {*TAGS}:
        raise InvalidInput(f"has unknown tags {shown(sorted(unknown))}; known: {TAGS}")
    if order not in CELL_ORDERS:
        known = ", ".join(CELL_ORDERS)
        raise InvalidInput(f"has the unknown cell_order {shown(order)}; known: {known}")
    if policy in POLICIES.built_in:
        if {*tags} != {*tags_of(policy)}:
            raise InvalidInput(f"says that {policy} is {shown(tags)}, and it is {tags_of(policy)}")
        try:
            check_parameters(policy, maker(policy), dict(result.entry.parameters))
        except InvalidInput as error:
            raise InvalidInput(f"cannot be played: {error}") from error


def _check_worlds(result: BudgetResult) -> None:
    """Raise InvalidInput unless the worlds are all that are published, drawn afresh, or sealed. A
    choice among them would favour the entry.
    """
    by_part: dict[str, list[Any]] = {}
    for part, world in result.worlds:
        by_part.setdefault(part, []).append(world)
    for part, worlds in by_part.items():
        if len({*worlds}) < len(worlds):
            raise InvalidInput(f"holds a world of the {part} twice")
    published = budget_worlds(result.quick, closed_loop=True)
    if result.sealed or is_fresh(result):
        if [*by_part] != [STREETS]:
            raise InvalidInput("holds other parts than streets, and sealed and fresh worlds are")
        numbers = range(len(published[STREETS]))
        published = {STREETS: numbers if result.sealed else by_part[STREETS]}
    for part, due in published.items():
        if part in by_part and by_part[part] != [*due]:
            raise InvalidInput(
                f"holds other {part} than the {counted(len(due), 'world')} of the benchmark: play "
                f"it again with care-sim benchmark --policy {result.entry.policy}"
            )


def _check_published(result: BudgetResult) -> None:
    """Raise InvalidInput for a choice among the drives of a published source, whatever the
    detector.
    """
    known = references(MAIN_DETECTOR)
    published = known[0].worlds if known else ()
    sources = {source_of_world(world) for part, world in result.worlds if part in RECORDED_PARTS}
    due = {
        world
        for part, world in published
        if part in RECORDED_PARTS and source_of_world(world) in sources
    }
    if lacking := sorted(due - {world for _, world in result.worlds}):
        raise InvalidInput(f"lacks the recorded drive {lacking[0]}: play all of its source")


def is_fresh(result: BudgetResult) -> bool:
    """Return whether the result is of streets that `--fresh` drew."""
    streets = [world for part, world in result.worlds if part == STREETS]
    return bool(streets) and all(type(world) is int and world in FRESH for world in streets)


def references(
    detector: str, worlds: Sequence[tuple[str, int | str]] | None = None
) -> list[BudgetResult]:
    """Return the published entries under a detector in these worlds, or in all that they played;
    none without such plays.
    """
    # A result file may name any text as its detector, a path too.
    published = {path.stem: path for path in _REFERENCES.glob("*.json")}
    results = read_list(published[detector]) if detector in published else []
    if worlds is None:
        return results
    cut = (result.cut_to(worlds) for result in results)
    return [result for result in cut if result]


def with_references(results: Sequence[BudgetResult]) -> list[BudgetResult]:
    """Return results of the same worlds and detector with the published entries there. One that
    reached other counts than the published entry of its name stands beside it.
    """
    own = [(result.entry, result.rows) for result in results]
    first = results[0]
    is_alone = first.sealed or first.detector_parameters
    published = [] if is_alone else references(first.detector, first.worlds)
    return [*results, *(each for each in published if (each.entry, each.rows) not in own)]


def publish_references(results: Sequence[BudgetResult]) -> None:
    """For maintainers: make these the published entries under their detectors."""
    for detector in dict.fromkeys(result.detector for result in results):
        own = [result for result in results if result.detector == detector]
        write_list(_REFERENCES / f"{detector}.json", own)


def read_list(path: Path) -> list[BudgetResult]:
    """Read a list of published results. Raises InvalidInput where one is damaged."""
    return [*_parsed_list(path.read_text(encoding="utf-8"), path.name)]


def write_list(path: Path, results: Sequence[BudgetResult]) -> None:
    """Write a list of published results, one per line."""
    listed = ",\n".join(json.dumps(result.content()) for result in results)
    write_text(path, f"[\n{listed}\n]\n")


# By the text, since every file that the leaderboard reads is compared with the published entries.
@lru_cache(maxsize=8)
def _parsed_list(text: str, origin: str) -> tuple[BudgetResult, ...]:
    return tuple(result_of(content, origin) for content in parsed_json(text))
