"""Every contrast of the paper's evaluation beside what was measured, and whether it is met."""

from collections import Counter
from collections.abc import Iterator, Mapping

from care_sim.base.text import percent
from care_sim.reports.protocol.differences import Compared, Gap, Third
from care_sim.reports.protocol.formatting import MET, NOT_MET, UNDECIDED, interval, judged, verdict
from care_sim.reports.protocol.notes import UNITS, on_intervals, papers
from care_sim.reports.protocol.paper import BUDGETS, Said, statements_about
from care_sim.reports.protocol.rows import Plays
from care_sim.reports.table import Table

Measured = Mapping[Compared, Mapping[float, Gap | None]]
"""What was measured of every statement, by budget."""
RULE = (
    "In brackets: the paper's. Met: the interval excludes zero on the side that the paper says, or "
    "contains zero where it says tied. Not met: it excludes zero on the other side, or at all "
    "where the paper says tied. Undecided: it contains zero where the paper claims a sign, or "
    "there is none. A tie that is met shows no difference; it does not show that there is none."
)
THIRDS = (
    "Thirds of the scenes, by tracked objects or by explained detections: care minus all-camera."
)
UNIFORM = (
    "The paper does not say in which measure history-uniform falls below history: both are tested."
)


def statements_tables(plays: Plays) -> list[Table]:
    """One line a statement, at the paper's budgets; none where the paper says nothing of such
    plays.
    """
    said = statements_about(plays.setting)
    budgets = [budget for budget in plays.budgets if budget in BUDGETS]
    found = {
        each: {budget: each.gap(plays, budget) for budget in budgets}
        for each in said
        if _is_played(each, plays)
    }
    measured = {each: gaps for each, gaps in found.items() if any(gaps.values())}
    if not measured:
        return []
    columns = [name for budget in budgets for name in (percent(budget), "interval")]
    return [
        Table(
            f"{plays.setting.label}: the paper's statements",
            ("statement", *columns),
            tuple(_lines(measured, said)),
            (
                _count(measured, said),
                f"{UNITS} {RULE}",
                *_asides(measured),
                *on_intervals(gap for gaps in measured.values() for gap in gaps.values()),
                *_not_played(plays, said),
            ),
            papers(said[each].source for each in measured),
            files_only=("interval",),
            whole=("statement",),
        )
    ]


def _is_played(statement: Compared, plays: Plays) -> bool:
    return set(statement.policies) <= set(plays.policies)


def _lines(measured: Measured, said: Mapping[Compared, Said]) -> Iterator[tuple[str, ...]]:
    heading = ""
    for each, gaps in measured.items():
        if each.heading != heading:
            heading = each.heading
            yield (heading,)
        yield (
            each.label,
            *(entry for budget, gap in gaps.items() for entry in _entries(gap, said[each], budget)),
        )


def _entries(gap: Gap | None, said: Said, budget: float) -> tuple[str, str]:
    """The difference with the verdict and the paper's beside it; its interval."""
    return judged(gap, said.sign(budget), said.short(budget)), interval(gap)


def _count(measured: Measured, said: Mapping[Compared, Said]) -> str:
    claims = [
        (gap, said[each].sign(budget))
        for each, gaps in measured.items()
        for budget, gap in gaps.items()
    ]
    verdicts = Counter(
        verdict(gap, claimed) for gap, claimed in claims if gap and claimed is not None
    )
    listed = ", ".join(f"{verdicts[each]} {each}" for each in (MET, NOT_MET, UNDECIDED))
    return f"Of {verdicts.total()}, each budget counted: {listed}."


def _asides(measured: Measured) -> tuple[str, ...]:
    thirds = any(isinstance(each, Third) for each in measured)
    uniform = any("history-uniform" in each.policies for each in measured)
    return (*((THIRDS,) if thirds else ()), *((UNIFORM,) if uniform else ()))


def _not_played(plays: Plays, said: Mapping[Compared, Said]) -> tuple[str, ...]:
    named = dict.fromkeys(
        policy for each in said for policy in each.policies if policy not in plays.policies
    )
    return (
        (f"The paper also speaks of policies that were not played: {', '.join(named)}.",)
        if named
        else ()
    )
