"""Compare the engine `fast` with Bullet: `make parity`.

In random scenes, in full scans and pictures of the keyframes of every scenario, and in the course
of the episodes of the paper's study.
"""

import argparse
import json
import sys
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from care_sim.base.files import write_text
from care_sim.reports.figures.styles import BLUE, ORANGE, default_style, save
from care_sim.scenarios import PAPER_SCENARIOS
from care_sim.study.progress import shown_progress
from care_sim.study.provenance import machine, versions
from tests.parity.episodes import keyframes, outcomes
from tests.parity.rays import GROUPS, REFERENCES, SAME, VERDICTS
from tests.parity.scenes import random_scenes

RANDOM = "random scenes"
STYLES = dict(zip(REFERENCES, ((BLUE, "o", "full"), (ORANGE, "D", "none")), strict=True))


def main(arguments=None):
    """Compare, print, write; 0 where the engines agree as `agree` says, else 1."""
    parser = argparse.ArgumentParser(prog="make parity", description=__doc__.partition("\n")[0])
    told = "seeds, from 0, of every scenario and of the paper's study"
    parser.add_argument("--scenes", type=int, default=100_000, help="random scenes")
    parser.add_argument("--episodes", type=int, default=5, help=told)
    parser.add_argument("--seed", type=int, default=0, help="of the random scenes")
    parser.add_argument("--out", type=Path, help="JSON of all counts; a figure is drawn beside it")
    options = parser.parse_args(arguments)
    report = parity_report(options.scenes, options.episodes, options.seed)
    print(*lines(report), sep="\n")
    if options.out:
        write_text(options.out, json.dumps(report, indent=2) + "\n")
        save(parity_figure(report), options.out.with_suffix(""))
    return 0 if agree(report) else 1


def parity_report(scenes, episodes, seed):
    """`config`, `machine` and `versions`; `scans`, the figures of random scenes and of every
    scenario of one encounter; `pictures`, those of these scenarios; and `outcomes`, those of whole
    episodes.
    """
    scans = {RANDOM: _shown("scenes", scenes, partial(random_scenes, seed))}
    pictures = {}
    for name in PAPER_SCENARIOS:
        compared = _shown(f"{name} episodes", episodes, partial(keyframes, name))
        scans[name], pictures[name] = compared
    ended = _shown("seeds of the paper's study", episodes, outcomes)
    return {
        "config": {"scenes": scenes, "episodes": episodes, "seed": seed},
        "machine": machine(),
        "versions": versions(),
        "scans": {name: counts.figures() for name, counts in scans.items() if counts.scans},
        "pictures": {name: vars(seen) for name, seen in pictures.items() if seen.pictures},
        "outcomes": vars(ended),
    }


def _shown(unit, total, compare):
    with shown_progress(total, unit) as show:
        return compare(total, lambda done: show(done, ""))


def agree(report):
    """Whether every difference from Bullet in millimetres has an explanation, visible boxes end
    within a pixel, and episodes end as under Bullet.

    Bullet in its own metres is no judge of rays: its tolerance of 1 mm decides some.
    """
    boxes = max((figures["widest_px"] for figures in report["pictures"].values()), default=0.0)
    return not unexplained(report) and boxes <= 1 and not report["outcomes"]["other_outcomes"]


def unexplained(report):
    """How many rays differ from Bullet in millimetres without an explanation."""
    met = (figures["references"][REFERENCES[-1]].values() for figures in report["scans"].values())
    return sum(counts["unexplained"] for groups in met for counts in groups)


def lines(report):
    """The lines to print: the counts that are not 0."""
    for name, figures in report["scans"].items():
        yield f"{name}: {figures['scans']:,} scans"
        for reference, met in figures["references"].items():
            yield f"  against {reference}"
            for group, counts in met.items():
                if counts["rays"]:
                    yield f"    {group}: {_counted(counts)}"
    for name, counts in report["pictures"].items():
        yield f"pictures of {name}: {_counted(counts)}"
    ended = report["outcomes"]
    yield f"episodes under both engines: {ended['episodes']:,}, keyframes {ended['keyframes']:,}"
    for name in ("other_outcomes", "other_than_exact", "other_keyframes"):
        yield f"  {name}: {len(ended[name])} {', '.join(ended[name])}".rstrip()


def _counted(counts):
    return ", ".join(f"{name} {count:,.3g}" if isinstance(count, float) else f"{name} {count:,}"
                     for name, count in counts.items() if count)  # fmt: skip


@default_style()
def parity_figure(report):
    """Draw the rays per million that differ between `fast` and each reference: a panel for random
    scenes, one for the keyframes of all scenarios. Kinds that no ray meets have no marker.
    """
    panels = {RANDOM: [own for name, own in report["scans"].items() if name == RANDOM]}
    panels["keyframes of the scenarios"] = [
        own for name, own in report["scans"].items() if name != RANDOM
    ]
    panels = {title: scans for title, scans in panels.items() if scans}
    figure = Figure(figsize=(9.2, 3.4), layout="constrained")
    row = figure.subplots(1, len(panels), squeeze=False, sharex=True, sharey=True)[0]
    for axes, (title, scans) in zip(row, panels.items(), strict=True):
        axes.set_title(f"{title}: {sum(own['scans'] for own in scans):,} scans", loc="left")
        # Shares span seven powers of ten, and none is a result too: one ray of all that are cast
        # stands apart from it.
        axes.set_xscale("symlog", linthresh=0.01)
        for reference, (colour, marker, filled) in STYLES.items():
            met = [own["references"][reference] for own in scans]
            rays = {group: sum(own[group]["rays"] for own in met) for group in GROUPS}
            alike = {group: sum(own[group][VERDICTS[SAME]] for own in met) for group in GROUPS}
            shares = {g: 1e6 * (rays[g] - alike[g]) / rays[g] for g in GROUPS if rays[g]}
            places = [GROUPS.index(group) for group in shares]
            style = {
                "color": colour,
                "label": f"from {reference}",
                "clip_on": False,
                "fillstyle": filled,
            }
            axes.plot([*shares.values()], places, marker, **style)
        axes.set_xlim(0, 1e6)
    row[0].set_yticks(range(len(GROUPS)), GROUPS)
    row[0].set_ylim(len(GROUPS) - 0.5, -0.5)
    figure.supxlabel("rays per million that differ (at 0: none)", fontsize=9)
    figure.legend(*row[0].get_legend_handles_labels(), loc="outside upper right", frameon=False)
    return figure


if __name__ == "__main__":
    sys.exit(main())
