"""How the protocol's numbers are written in tables, ours and the paper's."""

from collections.abc import Collection, Iterable, Iterator, Sequence

from care_sim.base.errors import counted, percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.recall import Tally
from care_sim.evaluation.scene_contrasts import Ratio, SceneShare
from care_sim.evaluation.sightings import ANNOTATED, VISIBLE
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.measures import Recall
from care_sim.reports.engine.tables import PAPER
from care_sim.reports.formatting import bounds, emphasised, mean, signed
from care_sim.reports.protocol.paper import Claim, Claims
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.study.run_config import FULL, Row

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
    """Return the paper's claims at each of these budgets; nothing at all if it makes none."""
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


# Quoted under tables as they stand: nothing here is compared with anything. The numbers in them are
# data in care_sim.reports.protocol.paper.
UNITS_OF_DIFFERENCES = "Recall in points; TTFD in keyframes, less is better."


def played(plays: SettingPlays) -> str:
    """Scenes, events, object frames and floor seeds."""
    total = _counts(plays.scenes.values())
    # The most that any policy has at a budget: some may have been played with fewer.
    seeds = {
        len(plays.seeds(policy, budget)) for policy in plays.policies for budget in plays.budgets
    }
    kinds = ", ".join(f"{count:,.0f} {kind}" for kind, count in plays.newcomers.items())
    return (
        f"{counted(len(plays.scenes), 'scene')}, {total.events:,.0f} events"
        f"{f' ({kinds})' if kinds else ''}, {total.frames:,.0f} "
        f"object frames; {counted(max(seeds, default=0), 'floor seed')}."
    )


def _by_both_counts(scenes: Collection[Row]) -> str:
    """How many events there are by the other presence, given one row of every scene; nothing where
    rows do not tell.
    """
    # Rows of earlier versions lack the column.
    if any(row.get("emerging") is None for row in scenes):
        return ""
    emerging = sum(row["emerging"] for row in scenes)
    if any(row.get("presence") == VISIBLE for row in scenes):
        return f" Presence {ANNOTATED} does not count {emerging:,} of them."
    every = _counts(scenes).events + emerging
    return f" Presence {VISIBLE} counts {counted(emerging, 'more event')}, {every:,.0f} in all."


def _counts(scenes: Iterable[Row]) -> Tally:
    """Events and object frames, given one row of every scene."""
    return sum((Tally(events=row["events"], frames=row["frames"]) for row in scenes), Tally())


def of_full(plays: SettingPlays) -> tuple[str, ...]:
    """A note where there is no share of the full scan's recall."""
    return () if plays.full else ("Of full: the full scan was not played.",)


def left_out(plays: SettingPlays) -> tuple[str, ...]:
    """How many scenes lack a play of a policy; they are left out of its levels and contrasts."""
    missing = "; ".join(_missing(plays))
    return (f"Scenes without a play, left out: {missing}.",) if missing else ()


def papers(sources: Iterable[str]) -> tuple[str, ...]:
    """The paper's sentences, each once."""
    # A dict keeps the order in which the table meets the sentences.
    return tuple(f'Paper: "{source}"' for source in dict.fromkeys(sources))


def _missing(plays: SettingPlays) -> Iterator[str]:
    for policy in plays.policies:
        lacking = {
            budget: len(plays.scenes) - len(plays.tallies(policy, budget))
            for budget in plays.budgets
        }
        listed = [f"{count} at {percent(budget)}" for budget, count in lacking.items() if count]
        if listed:
            yield f"{policy} {', '.join(listed)}"
    if plays.full and (count := len(plays.scenes) - len(plays.tallies(FULL, 1.0))):
        yield f"{FULL} {count}"


def protocol_closing(rows: Sequence[Row]) -> list[str]:
    """The size of the study."""
    # Events and object frames belong to the film: one row of a scene is enough.
    scenes = {(row["source"], row["scene"]): row for row in rows}
    total = _counts(scenes.values())
    keyframes = sum(row["keyframes"] for row in scenes.values())
    return [
        f"Scenes: {len(scenes):,}, with {total.events:,.0f} first sightings and "
        f"{total.frames:,.0f} object frames in {keyframes:,} keyframes; plays: "
        f"{len(rows):,}.{_by_both_counts(scenes.values())}"
    ]
