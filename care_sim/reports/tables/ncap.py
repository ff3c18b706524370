"""Tables of the Euro NCAP tests: how they ended, by test and in all, and who scores more."""

from collections.abc import Mapping, Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.collision_outcomes import CollisionOutcome
from care_sim.reports.engine.controls import BEST_CONTROL
from care_sim.reports.formatting import interval, tag_notes
from care_sim.reports.ncap import READINGS, Line, NcapRows, overall
from care_sim.reports.table import Table, TableRow
from care_sim.study.run_config import FULL, REFERENCE, Row


def ncap_tables(rows: Sequence[Row]) -> list[Table]:
    """How the tests ended, then how the scores in all differ."""
    results = NcapRows(rows)
    return [_endings(results, each_test=True), *_differences_table(results)]


def ncap_headline(rows: Sequence[Row]) -> Table:
    """How the tests ended in all."""
    return _endings(NcapRows(rows), each_test=False)


def _endings(results: NcapRows, each_test: bool) -> Table:
    lines: list[TableRow] = []
    for budget in results.budgets or [1.0]:
        lines.append((f"budget {percent(budget)}",))
        tests = [(line.label, [line]) for line in results.lines] if each_test else []
        tests += [(_in_all(results, each), results.reading(each)) for each in results.readings]
        for label, held in tests:
            entries = (_entry(results, policy, budget, held) for policy in results.policies)
            lines.append((label, *entries))
    columns = ("test", *map(results.marked, results.policies))
    title = "Euro NCAP tests: avoided/mitigated/hit, and score"
    return Table(title, columns, tuple(lines), tag_notes(results.tags.values()))


def _entry(results: NcapRows, policy: str, budget: float, held: Sequence[Line]) -> str:
    contender = results.contender(policy, budget)
    endings = results.endings(contender, held)
    if not endings:
        return "-"
    counts = "/".join(str(endings[each]) for each in CollisionOutcome)
    return f"{counts} {overall(results.scores(contender, held)):.2f}"


def _in_all(results: NcapRows, reading: bool) -> str:
    return f"in all, cars {READINGS[reading]}" if len(results.readings) > 1 else "in all"


def _differences_table(results: NcapRows) -> list[Table]:
    """What each policy scores more than CARE, and than the best control, in all; none without
    either.
    """
    lines: list[TableRow] = []
    for reading in results.readings:
        held = results.reading(reading)
        best = {each: results.best_control(each, held) for each in results.budgets}
        if REFERENCE in results.tags:
            lines.append((f"{_in_all(results, reading)}: minus {REFERENCE}",))
            lines += _differences(results, held, dict.fromkeys(results.budgets, REFERENCE))
        if any(best.values()):
            lines.append((f"{_in_all(results, reading)}: minus the {BEST_CONTROL}",))
            lines.append((BEST_CONTROL, *(name or "" for name in best.values())))
            lines += _differences(results, held, best)
    title = "Euro NCAP tests: score in all, differences"
    columns = ("policy", *map(percent, results.budgets))
    notes = tag_notes(results.tags.values())
    return [Table(title, columns, tuple(lines), notes)] if lines else []


def _differences(
    results: NcapRows, held: Sequence[Line], against: Mapping[float, str | None]
) -> list[TableRow]:
    """A line for every policy but those that all are held against."""
    lines: list[TableRow] = []
    for policy in sorted(results.policies, key=lambda name: name == FULL):
        if {*against.values()} != {policy}:
            found = (
                results.difference(results.contender(policy, budget), (other, budget), held)
                if other and other != policy
                else None
                for budget, other in against.items()
            )
            lines.append((results.marked(policy), *map(interval, found)))
    return lines
