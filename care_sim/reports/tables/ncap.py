"""Tables of the Euro NCAP tests: how they ended, by test and in all, and who scores more."""

from collections.abc import Iterable, Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.collision_outcomes import CollisionOutcome
from care_sim.reports.controls import BEST_CONTROL, IN_HINDSIGHT
from care_sim.reports.formatting import interval
from care_sim.reports.ncap import READINGS, Contender, Line, NcapRows, overall
from care_sim.reports.table import Table
from care_sim.study.run_config import FULL, REFERENCE, Row


def ncap_tables(rows: Sequence[Row]) -> list[Table]:
    """How the tests ended, then how the scores in all differ."""
    results = NcapRows(rows)
    return [_endings_table(results), *_differences_table(results)]


def _endings_table(results: NcapRows) -> Table:
    lines: list[tuple[str, ...]] = []
    for budget in results.budgets or [1.0]:
        contenders = [results.contender(policy, budget) for policy in results.policies]
        lines.append((f"budget {percent(budget)}",))
        lines += [
            (line.label, *(_entry(results, each, [line]) for each in contenders))
            for line in results.lines
        ]
        for reading in results.readings:
            entries = (_entry(results, each, results.reading(reading)) for each in contenders)
            lines.append((_in_all(results, reading), *entries))
    return Table(
        "Euro NCAP tests: avoided/mitigated/hit, and score",
        ("test", *map(results.marked, results.policies)),
        tuple(lines),
        results.notes(),
        whole=("test",),
    )


def _entry(results: NcapRows, contender: Contender, lines: Iterable[Line]) -> str:
    held = list(lines)
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
    lines: list[tuple[str, ...]] = []
    for reading in results.readings:
        held = results.reading(reading)
        best = {each: results.best_control(each, held) for each in results.budgets}
        if REFERENCE in results.tags:
            against = dict.fromkeys(results.budgets, REFERENCE)
            lines.append((f"{_in_all(results, reading)}: minus {REFERENCE}",))
            lines += _differences(results, held, against)
        if any(best.values()):
            lines.append((f"{_in_all(results, reading)}: minus the {BEST_CONTROL}",))
            lines.append((BEST_CONTROL, *(name or "" for name in best.values())))
            lines += _differences(results, held, best)
    title = "Euro NCAP tests: score in all, differences"
    columns = ("policy", *map(percent, results.budgets))
    notes = (IN_HINDSIGHT, *results.notes())
    return [Table(title, columns, tuple(lines), notes, whole=columns[:1])] if lines else []


def _differences(
    results: NcapRows, held: Sequence[Line], against: dict[float, str | None] | dict[float, str]
) -> list[tuple[str, ...]]:
    """A line for every policy but those that all are held against."""
    rivals = [name for name in results.policies if {*against.values()} != {name}]
    return [
        (
            results.marked(policy),
            *(
                interval(
                    results.difference(results.contender(policy, budget), (other, budget), held)
                )
                if other and other != policy
                else ""
                for budget, other in against.items()
            ),
        )
        for policy in sorted(rivals, key=lambda name: name == FULL)
    ]
