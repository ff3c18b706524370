"""Results of B90 made by hand: every count has one curve."""

from contextlib import contextmanager

from care_sim.evaluation.smallest_budget import BUDGETS
from care_sim.policies import BUILT_IN, tags_of
from care_sim.study.benchmark.budgets import COUNTS, STREETS_PLAYED, BudgetResult, BudgetRow
from care_sim.study.benchmark.play import Player
from care_sim.study.benchmark.recorded import AHEAD, LABELLED_AHEAD, RECORDED, source_of_world
from care_sim.study.benchmark.suite import STREETS, Entry
from care_sim.study.journal import Journal
from care_sim.study.run_config import FULL as FULL_SCAN
from care_sim.study.scene_play import DECISION_MS

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


@contextmanager
def made_plays(folder):
    """A player of `MadePlays` with a journal in the folder."""
    with Journal(folder / "plays.jsonl") as journal:
        yield MadePlays(journal, 1, None)


class MadePlays(Player):
    """Plays nothing: every row is made before it would be played. On streets the counts are those
    of `made_budgets("care", HALF_WAY)`. A decision of the n-th budget takes n and 10 n ms, of the
    full scan 99 and 999. Episodes collide, but not under the full scan.
    """

    def rows(self, configs):
        for config in configs:
            if config.key not in self._journal:
                self._journal.append({"digest": config.key, **_made_row(config)})
        return super().rows(configs)


def _made_row(config):
    if config.policy == FULL_SCAN:
        share, times = 1.0, (99, 999)
    else:
        n = BUDGETS.index(config.budget)
        share, times = HALF_WAY[n], (n + 1, 10 * (n + 1))
    if not hasattr(config, "scene"):
        return {"collision": config.policy != FULL_SCAN, "braked_before_view": False}
    counts = {f"expected/{name}": FULL * share for name in COUNTS[STREETS]}
    return counts | dict(zip(DECISION_MS, times, strict=True))
