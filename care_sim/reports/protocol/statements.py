"""Every contrast of the paper's evaluation beside what was measured, and whether it is met."""

from collections import Counter

from care_sim.base.errors import percent
from care_sim.reports.formatting import ends
from care_sim.reports.protocol.formatting import MET, NOT_MET, UNDECIDED, judged, verdict
from care_sim.reports.protocol.notes import papers
from care_sim.reports.protocol.paper import PAPER_BUDGETS, claims_about
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.reports.table import Table, TableRow


def statements_tables(plays: SettingPlays) -> list[Table]:
    """One line per statement, at the paper's budgets; none where the paper says nothing of such
    plays.
    """
    said = claims_about(plays.setting)
    # Only the budgets of which the paper speaks: a verdict needs a claim.
    budgets = [budget for budget in plays.budgets if budget in PAPER_BUDGETS]
    lines: list[TableRow] = []
    sources: list[str] = []
    verdicts: Counter[str] = Counter()
    heading = ""
    for each, claims in said.items():
        if not set(each.policies) <= set(plays.policies):
            continue
        found = {budget: each.measured(plays, budget) for budget in budgets}
        if not any(found.values()):
            continue
        # Statements come measure by measure. A heading opens each measure.
        if each.heading != heading:
            heading = each.heading
            lines.append((heading,))
        entries = [
            entry
            for budget, difference in found.items()
            for entry in (judged(difference, claims.at(budget)), ends(difference))
        ]
        lines.append((each.label, *entries))
        sources.append(claims.source)
        # A budget that was not played, or of which the paper says nothing, is no verdict.
        verdicts.update(
            verdict(difference, claim.sign)
            for budget, difference in found.items()
            if difference and (claim := claims.at(budget))
        )
    if not lines:
        return []
    listed = ", ".join(f"{verdicts[each]} {each}" for each in (MET, NOT_MET, UNDECIDED))
    return [
        Table(
            f"{plays.setting.label}: the paper's statements",
            ("statement", *(name for each in budgets for name in (percent(each), "interval"))),
            tuple(lines),
            (f"{verdicts.total()} verdicts, the paper's difference in brackets: {listed}.",),
            papers(sources),
            files_only=("interval",),
        )
    ]
