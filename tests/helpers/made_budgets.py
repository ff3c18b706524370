"""Results of B90 made by hand: every count has one curve."""

from care_sim.evaluation.smallest_budget import BUDGETS
from care_sim.policies import BUILT_IN, tags_of
from care_sim.study.benchmark.budgets import COUNTS, STREETS_PLAYED, BudgetResult, BudgetRow
from care_sim.study.benchmark.recorded import AHEAD, LABELLED_AHEAD, RECORDED, source_of_world
from care_sim.study.benchmark.suite import STREETS, Entry

HALF_WAY = (0.1, 0.2, 0.8, 1.0, 1.0, 1.0, 1.0)
"""90% at the geometric mean of 2 and 3%, 2.4%."""
ALWAYS, NEVER = (1.0,) * len(BUDGETS), (0.5,) * len(BUDGETS)
FULL = 8.0


def made_budgets(
    entry="care",
    *curves,
    detector="centerpoint",
    streets=STREETS_PLAYED,
    first=200,
    recorded=(),
    later=(),
    **given,
):
    """The result of an entry whose four counts have these curves, the last one for all others, on
    streets from the seed `first` on. In the drives named `recorded` each count has `later`, or the
    last curve.
    """
    entry = entry if isinstance(entry, Entry) else Entry(entry)
    names = COUNTS[STREETS]
    each = [curves[min(n, len(curves) - 1)] for n in range(len(names))]
    full, got = (FULL,) * len(names), _got(each)
    there = _got([later or curves[-1]] * len(names))
    rows = (
        *(BudgetRow(STREETS, first + n, full, got) for n in range(streets)),
        *(BudgetRow(_part(name), name, full, there) for name in recorded),
    )
    tags = tags_of(entry.policy) if entry.policy in BUILT_IN else ("causal",)
    told = {"tags": tags, "quick": False, "made_by": {"versions": {}}} | given
    return BudgetResult(entry, detector=detector, rows=rows, **told)


def _part(name):
    return AHEAD if source_of_world(name) in LABELLED_AHEAD else RECORDED


def _got(curves):
    return tuple(tuple(FULL * curve[n] for curve in curves) for n in range(len(BUDGETS)))
