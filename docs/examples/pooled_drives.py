"""First sightings over the drives of several sources: levels, and one policy less each other.

    python docs/examples/pooled_drives.py care results/data/recorded-kitti ...

The first argument is the policy that the others are held against; then folders of `care-sim
protocol`, played under one set of conditions. Whole drives are resampled, as in the tables of the
protocol: a drive is one sample, whatever source it is from.
"""

import sys
from pathlib import Path

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.recall import Tally
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, ratio_level, scene_contrast
from care_sim.evaluation.strata import NEWCOMERS
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.reports.report import read_results
from care_sim.study.run_config import FULL


def pooled(
    settings: list[SettingPlays], policy: str, budget: float, kind: str = ""
) -> dict[str, Tally]:
    """Return the tally of a policy in every drive that has newcomers."""
    found: dict[str, Tally] = {}
    for plays in settings:
        for scene, tally in plays.tallies(policy, budget, kind).items():
            if tally.events:
                found[f"{plays.setting.label}/{scene}"] = tally
    return found


def main(reference: str, folders: list[str]) -> None:
    """Print a Markdown table for all newcomers, one for each kind, and one of overall recall."""
    settings = [
        plays for name in folders for plays in plays_by_setting(read_results(Path(name))[0])
    ]
    budgets = sorted({budget for plays in settings for budget in plays.budgets})
    policies = dict.fromkeys(policy for plays in settings for policy in plays.policies)
    for ratio, kind in (*((FIRST_SIGHTING, kind) for kind in ("", *NEWCOMERS)), (OVERALL, "")):
        bound = pooled(settings, FULL, 1.0, kind)
        number = sum(map(ratio.denominator, bound.values()))
        level = ratio_level(ratio, bound).by_event or 0.0
        named = kind or ("object keyframes" if ratio == OVERALL else "all")
        print(f"\n{named}: {number:.0f} in {len(bound)} drives; full scan {level:.1f}%\n")
        print(f"| policy | {' | '.join(map(percent, budgets))} |")
        print("|---" * (len(budgets) + 1) + "|")
        for policy in policies:
            cells = [policy]
            for budget in budgets:
                ours, theirs = (
                    pooled(settings, name, budget, kind) for name in (reference, policy)
                )
                own = ratio_level(ratio, theirs).by_event
                text = "" if own is None else f"{own:.1f}"
                if own is not None and len(theirs) < len(bound):
                    text += f" in {len(theirs)} drives"
                less = scene_contrast(ratio, ours, theirs) if policy != reference else None
                if less and less.scenes >= FEWEST_PAIRS:
                    mean, low, high = less.by_event
                    text += f" ({mean:+.1f} [{low:.1f}, {high:.1f}])"
                cells.append(text)
            print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
