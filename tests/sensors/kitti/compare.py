"""Hold the profile `kitti` against the detector that it was fitted to: tables and a figure.

    python -m tests.sensors.kitti.compare results/figures/kitti-camera

KITTI's pictures and the detector's boxes are read from ../shared/data.
"""

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from care_sim.core.types import CLASSES
from care_sim.reports.figures.styles import BLUE, GREEN, INK, ORANGE, default_style, save
from care_sim.sensors.kitti import recall
from care_sim.sensors.kitti.numbers import measured
from tests.helpers.kitti_object import as_labels, kitti_pictures, matched, simulated

CONFIDENCE = 0.25
SEEDS = 4
STREETS, EPISODES = range(3000, 3006), 3
SCATTER_PX = 8.0
"""How far the lower edges of labels of equal height and class scatter in a picture of KITTI: cars
7.6, pedestrians 8.2 pixels.
"""
FEWEST = 20
"""Labels in a bin, for its share to be shown."""
HEIGHTS = {
    "car": (12, 20, 25, 30, 40, 60, 80, 120, 180, 300),
    "pedestrian": (20, 30, 40, 60, 80, 100, 140, 200, 350),
    "bicycle": (18, 25, 30, 40, 60, 100, 200),
}
LEVELS = ("not occluded", "partly", "largely")
COLOURS = (BLUE, ORANGE, GREEN)


def recall_table(told):
    """By class and level: per bin of heights the middle, labels, share found and formula."""
    labels, rows = as_labels(told)
    found = np.isin(rows, matched(told, told.found[told.found[:, 1] >= CONFIDENCE]))
    size = labels.boxes[:, 2:] - labels.boxes[:, :2]
    looks = size[:, 1], labels.levels, labels.beyond, told.told[rows, 2]
    table = {}
    for label, edges in HEIGHTS.items():
        predicted = recall(label, *looks, width_px=size[:, 0], cover=labels.cover)
        for level in range(len(LEVELS)):
            own = (labels.classes == CLASSES.index(label)) & (labels.levels == level)
            table[label, level] = [
                (
                    np.median(size[part, 1]),
                    part.sum(),
                    found[part].mean(),
                    predicted[part].mean(),
                )
                for low, high in pairwise(edges)
                if (part := own & (size[:, 1] >= low) & (size[:, 1] < high)).sum() >= FEWEST
            ]
    return table


def false_table(told, reported, excused):
    """(3, 2) false boxes per picture of every class, and their median score."""
    sure = reported[reported[:, 1] >= CONFIDENCE]
    false = sure[matched(told, sure, excused) == -1]
    own = [false[false[:, 0] == CLASSES.index(label)] for label in HEIGHTS]
    return np.array([(len(rows) / told.count, np.median(rows[:, 1])) for rows in own])


def areas(told, left_out=()):
    """Area under the curve of the real boxes, and of simulated ones of some seeds."""
    from tests.helpers.telling_false_boxes import area_under_the_curve

    found = []
    made = [simulated(told, measured().numbers, seed) for seed in range(SEEDS)]
    for reported, excused in [(told.found, True), *((one, False) for one in made)]:
        sure = reported[reported[:, 1] >= CONFIDENCE]
        behind = matched(told, sure, excused)
        rows, false = sure[behind != -2], behind[behind != -2] == -1
        half = rows[:, 6].astype(int) % 2
        found.append(area_under_the_curve(rows, false, half, left_out))
    return found


def street_areas():
    """The same of boxes that observations of streets show, by what is left out or changed."""
    from tests.helpers.telling_false_boxes import VERTICAL, area_under_the_curve, boxes_of_streets

    rows, false, streets = boxes_of_streets(STREETS, EPISODES)
    others, false_others, streets_of = boxes_of_streets(STREETS, EPISODES, "yolox")
    half = streets % 2
    moved = rows.copy()
    # In pixels of the surround cameras; the scatter is that of KITTI's feet at equal height.
    scatter = SCATTER_PX * 228.5 / 721.5
    moved[:, [3, 5]] += np.random.default_rng(0).normal(0, scatter, len(rows))[:, None]
    return {
        "as shown": area_under_the_curve(rows, false, half),
        "upper and lower edges left out": area_under_the_curve(rows, false, half, VERTICAL),
        f"moved up and down by {SCATTER_PX:.0f} px": area_under_the_curve(moved, false, half),
        "as shown, yolox": area_under_the_curve(others, false_others, streets_of % 2),
    }


@default_style()
def recall_figure(table):
    """A panel per class: points are the real detector's with 95% intervals, lines the formula's."""
    figure = Figure(figsize=(9.2, 3.2), layout="constrained")
    for axes, label in zip(figure.subplots(1, len(HEIGHTS), sharey=True), HEIGHTS, strict=True):
        for level, colour in enumerate(COLOURS):
            middles, numbers, found, predicted = np.reshape(table[label, level], (-1, 4)).T
            # Wilson's interval, which stays between 0 and 1.
            room = 1.96**2 / numbers
            middle = (found + room / 2) / (1 + room)
            half = np.sqrt(found * (1 - found) * room + room**2 / 4) / (1 + room)
            reach = [found - middle + half, middle + half - found]
            axes.errorbar(middles, found, reach, fmt="o", markersize=4, linewidth=1, color=colour)
            axes.plot(middles, predicted, color=colour, label=LEVELS[level])
        ticks = [px for px in (20, 40, 80, 160, 320) if HEIGHTS[label][0] < px < HEIGHTS[label][-1]]
        axes.set(title=label, xscale="log", xlabel="height in pixels", ylim=(0, 1.02))
        axes.set_xticks(ticks, list(map(str, ticks)))
        axes.minorticks_off()
    figure.axes[0].set_ylabel("recall at confidence 0.25", color=INK)
    figure.axes[0].legend(loc="lower right")
    return figure


def main(stem):
    """Print the tables and draw the figure."""
    from tests.helpers.telling_false_boxes import VERTICAL

    told = kitti_pictures()
    table = recall_table(told)
    for (label, level), bins in table.items():
        for middle, number, found, predicted in bins:
            print(
                f"{label}, {LEVELS[level]}, {middle:.0f} px: {number} labels,"
                f" {100 * found:.0f}% found, formula {100 * predicted:.0f}%"
            )
    made = [false_table(told, simulated(told, measured().numbers, n), False) for n in range(SEEDS)]
    both = false_table(told, told.found, True), np.mean(made, axis=0)
    print("false boxes per picture and their median score, real and simulated:")
    for label, real, simulated_ones in zip(HEIGHTS, *both, strict=True):
        print(label, real.round(3), simulated_ones.round(3))
    for left_out in ((), VERTICAL):
        real, *others = areas(told, left_out)
        print(
            f"told apart, columns {left_out} left out: real {real:.3f}, made {np.round(others, 3)}"
        )
    for how, area in street_areas().items():
        print(f"told apart on streets, {how}: {area:.3f}")
    save(recall_figure(table), stem)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
