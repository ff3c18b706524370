"""First sightings over the drives of several sources: levels, and one policy less each other.

    python docs/examples/pooled_drives.py care results/data/recorded-kitti ... --figure FILE

The first argument is the policy that the others are held against; then folders of `care-sim
protocol`, played under one set of conditions. Whole drives are resampled, as in the tables of the
protocol: a drive is one sample, whatever source it is from. `--figure` draws the levels, of
policies that played all drives, into FILE.svg.
"""

from argparse import ArgumentParser
from collections.abc import Iterable
from pathlib import Path

from matplotlib.figure import Figure

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.recall import Tally
from care_sim.evaluation.scene_contrasts import (
    FIRST_SIGHTING,
    OVERALL,
    Ratio,
    ratio_level,
    scene_contrast,
)
from care_sim.evaluation.strata import NEWCOMERS
from care_sim.reports.figures.curves import BUDGET, Panel, Point, curves_figure, point
from care_sim.reports.figures.styles import default_style, save
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.reports.report import read_results
from care_sim.study.run_config import FULL


def read_settings(folders: Iterable[Path]) -> list[SettingPlays]:
    """Return the plays of the folders, one for each setting."""
    return [plays for folder in folders for plays in plays_by_setting(read_results(folder)[0])]


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


@default_style()
def levels_figure(settings: list[SettingPlays]) -> Figure:
    """Draw the newcomers and the object keyframes that each policy detects, over the budget."""
    budgets = sorted({budget for plays in settings for budget in plays.budgets})
    drives = len(pooled(settings, FULL, 1.0))
    played = {name: tags for plays in settings for name, tags in plays.tags.items()}
    # The module of a policy is not part of its name.
    names = {name.rpartition(":")[2]: name for name in played}

    def panel(ratio: Ratio, label: str) -> Panel:
        def read(name: str, budget: float) -> Point | None:
            own = pooled(settings, names.get(name, FULL), 1.0 if name == FULL else budget)
            return point(ratio_level(ratio, own).by_event) if len(own) == drives else None

        return Panel.by_budget("", [*names, FULL], budgets, read, label=label)

    panels = [
        panel(FIRST_SIGHTING, "newcomers detected (%)"),
        panel(OVERALL, "object keyframes detected (%)"),
    ]
    tags = {name: played[policy] for name, policy in names.items()}
    title = f"{drives} recorded drives"
    return curves_figure("levels", title, panels, tags, [BUDGET])["levels"]


def main(reference: str, folders: list[str], figure: str | None = None) -> None:
    """Print a Markdown table for all newcomers, one for each kind, and one of overall recall."""
    settings = read_settings(map(Path, folders))
    if figure:
        save(levels_figure(settings), Path(figure))
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
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("reference")
    parser.add_argument("folders", nargs="+")
    parser.add_argument("--figure")
    given = parser.parse_args()
    main(given.reference, given.folders, given.figure)
