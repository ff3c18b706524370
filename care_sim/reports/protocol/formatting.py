"""How the protocol's numbers are written in tables, ours and the paper's."""

from collections.abc import Sequence

from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.scene_contrasts import Ratio, SceneShare
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.measures import Recall
from care_sim.reports.engine.tables import PAPER
from care_sim.reports.formatting import bounds, emphasised, mean, signed
from care_sim.reports.protocol.paper import Claim, Claims

__all__ = ["PAPER"]
MET = "met"
NOT_MET = "not met"
UNDECIDED = "undecided"
_SIGNS_ALONE = {1: "above", -1: "below", 0: "tied"}


def written(ratio: Ratio, value: float | None) -> str:
    """A level in the unit of its measure."""
    return Recall(ratio).written(value)


def rounded(share: float | None, unit: str = "") -> str:
    """A share in whole %."""
    return "" if share is None else f"{share:.0f}{unit}"


def share(found: SceneShare | None) -> str:
    """A share of the full scan's recall in whole %."""
    return rounded(found.interval.mean) if found else ""


def share_ends(found: SceneShare | None) -> str:
    """The interval of a share in whole %; empty of fewer scenes than carry one."""
    if found is None or found.scenes < FEWEST_PAIRS:
        return ""
    return bounds(found.interval, 0)


def share_with_ends(found: SceneShare | None) -> str:
    """A share with its interval if it has one."""
    return f"{share(found)} {share_ends(found)}".strip()


def claims_of_paper(claims: Claims | None, budgets: Sequence[float]) -> tuple[str, ...]:
    """What the paper says at each of these budgets; nothing at all where it speaks of none."""
    if claims is None or not claims.any_at(budgets):
        return ()
    return tuple(_claim(claims.at(budget)) for budget in budgets)


def _claim(claim: Claim | None) -> str:
    """A claim with all that the paper tells of it."""
    if claim is None:
        return ""
    # The paper's numbers have as many decimals as they need, and one at least. That is how Python
    # writes a float.
    ends = "" if claim.ends is None else f" [{claim.ends[0]},{claim.ends[1]}]"
    if claim.sign:
        return f"{claim_in_short(claim)}{ends}"
    bound = "" if claim.at_most is None else f", at most {claim.at_most}"
    size = "" if claim.mean is None else f", {claim.mean:+}{ends}"
    return f"{claim_in_short(claim)}{bound}{size}"


def claim_in_short(claim: Claim) -> str:
    """A claim without interval or size of a tie."""
    if claim.mean is None or not claim.sign:
        return _SIGNS_ALONE[claim.sign]
    return f"{claim.mean:+}" if claim.upper is None else f"{claim.mean:+} to {claim.upper}"


def verdict(difference: Contrast, claimed: int) -> str:
    """Whether a claim holds: 1 or -1 for a sign, 0 for a tie."""
    if difference.interval is None:
        return UNDECIDED
    if difference.sign == claimed:
        return MET
    # An interval around zero neither bears a claimed sign out nor speaks against it. One without
    # zero speaks against the other sign, and against a tie.
    return NOT_MET if difference.sign else UNDECIDED


def judged(difference: Contrast | None, claim: Claim | None) -> str:
    """A difference, whether it bears the claim out, and the claim itself; bold as `mean` is."""
    if difference is None:
        return ""
    if claim is None:
        return mean(difference)
    found = f"{signed(difference)} {verdict(difference, claim.sign)}{difference.suffix}"
    return emphasised(difference, f"{found} ({claim_in_short(claim)})")
