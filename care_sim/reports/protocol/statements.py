"""Every contrast of the paper's evaluation beside what was measured, and whether it is met."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from care_sim.base.errors import percent
from care_sim.reports.formatting import ends
from care_sim.reports.protocol.differences import Comparison, MeasuredDifference
from care_sim.reports.protocol.formatting import MET, NOT_MET, UNDECIDED, judged, verdict
from care_sim.reports.protocol.notes import UNITS_OF_DIFFERENCES, on_intervals, papers
from care_sim.reports.protocol.paper import PAPER_BUDGETS, Claims, claims_about
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.reports.protocol.thirds import SceneThird
from care_sim.reports.table import Table

_Measured = Mapping[Comparison, Mapping[float, MeasuredDifference | None]]
"""What was measured of every statement, by budget."""
_RULE = (
    "In brackets: the paper's. Met: the interval excludes zero on the side that the paper says, or "
    "contains zero where it says tied. Not met: it excludes zero on the other side, or at all "
    "where the paper says tied. Undecided: it contains zero where the paper claims a sign, or "
    "there is none. A tie that is met shows no difference; it does not show that there is none."
)
_THIRDS = (
    "Thirds of the scenes, by tracked objects or by explained detections: care minus all-camera."
)
_UNIFORM = (
    "The paper does not say in which measure history-uniform falls below history: both are tested."
)


def statements_tables(plays: SettingPlays) -> list[Table]:
    """One line per statement, at the paper's budgets; none where the paper says nothing of such
    plays.
    """
    said = claims_about(plays.setting)
    # Only the budgets of which the paper speaks: a verdict needs a claim.
    budgets = [budget for budget in plays.budgets if budget in PAPER_BUDGETS]
    measured = _measured(plays, said, budgets)
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
                f"{UNITS_OF_DIFFERENCES} {_RULE}",
                *_asides(measured),
                *on_intervals(
                    difference
                    for differences in measured.values()
                    for difference in differences.values()
                ),
                *_not_played(plays, said),
            ),
            papers(said[each].source for each in measured),
            files_only=("interval",),
            whole=("statement",),
        )
    ]


def _measured(
    plays: SettingPlays, said: Iterable[Comparison], budgets: Sequence[float]
) -> _Measured:
    """What was measured of the statements; none of those without any difference."""
    found = {
        each: {budget: each.measured(plays, budget) for budget in budgets}
        for each in said
        if set(each.policies) <= set(plays.policies)
    }
    return {each: differences for each, differences in found.items() if any(differences.values())}


def _lines(measured: _Measured, said: Mapping[Comparison, Claims]) -> Iterator[tuple[str, ...]]:
    # Statements come measure by measure. A heading opens each measure.
    heading = ""
    for each, differences in measured.items():
        if each.heading != heading:
            heading = each.heading
            yield (heading,)
        yield (
            each.label,
            *(
                entry
                for budget, difference in differences.items()
                for entry in _entries(difference, said[each], budget)
            ),
        )


def _entries(
    difference: MeasuredDifference | None, claims: Claims, budget: float
) -> tuple[str, str]:
    """The difference with the verdict and the paper's beside it; its interval."""
    return judged(difference, claims.at(budget)), ends(difference)


def _count(measured: _Measured, said: Mapping[Comparison, Claims]) -> str:
    verdicts = Counter(
        verdict(difference, claim.sign)
        for each, differences in measured.items()
        for budget, difference in differences.items()
        # A budget that was not played, or of which the paper says nothing, is no verdict.
        if difference and (claim := said[each].at(budget))
    )
    listed = ", ".join(f"{verdicts[each]} {each}" for each in (MET, NOT_MET, UNDECIDED))
    return f"Of {verdicts.total()}, each budget counted: {listed}."


def _asides(measured: _Measured) -> tuple[str, ...]:
    thirds = any(isinstance(each, SceneThird) for each in measured)
    uniform = any("history-uniform" in each.policies for each in measured)
    return (*((_THIRDS,) if thirds else ()), *((_UNIFORM,) if uniform else ()))


def _not_played(plays: SettingPlays, said: Mapping[Comparison, Claims]) -> tuple[str, ...]:
    named = dict.fromkeys(
        policy for each in said for policy in each.policies if policy not in plays.policies
    )
    return (
        (f"The paper also speaks of policies that were not played: {', '.join(named)}.",)
        if named
        else ()
    )
