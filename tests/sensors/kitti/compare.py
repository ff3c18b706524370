"""Hold the profile `kitti` against the detector that it was fitted to: tables and a figure.

    python -m tests.sensors.kitti.compare results/figures/kitti-camera

KITTI's pictures and the detector's boxes are read from ../shared/data.
"""

import sys
import zlib
from functools import partial
from itertools import pairwise
from pathlib import Path
from unittest.mock import patch

import numpy as np
from matplotlib.figure import Figure

from care_sim.core.types import CLASSES
from care_sim.reports.figures.styles import BLUE, GREEN, INK, ORANGE, default_style, save
from care_sim.sensors.kitti import detector, recall
from care_sim.sensors.kitti.labels import labels_of
from care_sim.sensors.kitti.numbers import FOCAL_PX, measured
from tests.helpers.kitti_object import as_labels, halves, kitti_pictures, matched, simulated
from tests.helpers.telling_false_boxes import (
    ALL_BUT_FOOT,
    area_under_the_curve,
    boxes_of_streets,
    on_a_flat_road,
)
from tests.sensors.kitti.halves import held_out, held_out_by_luck

CONFIDENCE = 0.25
SEEDS = 4
STREETS, EPISODES = range(3000, 3006), 3
CAR_HEIGHTS, PICTURE_PX, OBJECT_PX = 0.09, 7.0, 5.0
"""Variation that streets lack: the spread of cars' heights on KITTI, and how far the ground of a
picture's labels, and of each label in it, is from that of a flat road.
"""
FEWEST = 20
"""Labels in a bin, for its share to be shown."""
HEIGHTS = {
    "car": (12, 20, 25, 30, 40, 60, 80, 120, 180, 300),
    "pedestrian": (20, 30, 40, 60, 80, 100, 140, 200, 350),
    "bicycle": (18, 25, 30, 40, 60, 100, 200),
}
SIZES = (0, 25, 40, 60, 100, 400)
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


def sizes_of_false(told, reported, excused):
    """(3, 5) false boxes of every class by their height, between SIZES."""
    sure = reported[reported[:, 1] >= CONFIDENCE]
    false = sure[matched(told, sure, excused) == -1]
    high = false[:, 5] - false[:, 3]
    own = [high[false[:, 0] == CLASSES.index(label)] for label in HEIGHTS]
    return np.array([np.histogram(each, SIZES)[0] for each in own])


def areas(told, left_out=(), flat=False):
    """Area under the curve of the real boxes, and of simulated ones of some seeds."""
    found = []
    made = [simulated(told, measured().numbers, seed) for seed in range(SEEDS)]
    for reported, excused in [(told.found, True), *((one, False) for one in made)]:
        sure = reported[reported[:, 1] >= CONFIDENCE]
        behind = matched(told, sure, excused)
        rows, false = sure[behind != -2], behind[behind != -2] == -1
        shown = on_a_flat_road(told, rows) if flat else rows
        half = halves()[rows[:, 6].astype(int)]
        found.append(area_under_the_curve(shown, false, half, left_out))
    return found


def street_areas():
    """The same of boxes that observations of streets show: by all columns, and by class, height and
    lower edge alone; as they are, and with what streets lack.
    """
    heights = partial(_uneven, spread=CAR_HEIGHTS, shifts=(0.0, 0.0))
    roads = partial(_uneven, spread=CAR_HEIGHTS, shifts=(PICTURE_PX, OBJECT_PX))
    found = {}
    for name, labels in (("as shown", labels_of), ("heights", heights), ("roads too", roads)):
        python = patch.object(detector, "_report", detector._report.py_func)
        with python, patch.object(detector, "labels_of", labels):
            rows, false, streets = boxes_of_streets(STREETS, EPISODES)
        found[name] = [
            area_under_the_curve(rows, false, streets % 2, out) for out in ((), ALL_BUT_FOOT)
        ]
    return found


def _uneven(rows, places, visible, boxes, cameras, world, spread, shifts):
    """Labels of cars of uneven heights (`spread`) on roads that lie higher or lower, by picture and
    by object (`shifts`, pixels).
    """
    labels = labels_of(rows, places, visible, boxes, cameras, world)
    heights = np.random.default_rng(0).normal(0, spread, places.max(initial=0) + 1)[places]
    rng = np.random.default_rng(zlib.crc32(labels.boxes.tobytes()))
    moved = rng.normal(0, shifts[0], len(cameras.focals))[labels.cameras]
    moved += rng.normal(0, shifts[1], len(places))
    edges, is_car = labels.boxes.copy(), labels.classes < CLASSES.index("bicycle")
    edges[:, 1] -= np.where(is_car, heights, 0.0) * (edges[:, 3] - edges[:, 1])
    lowest = (cameras.sizes[:, 1] * FOCAL_PX / cameras.focals)[labels.cameras]
    edges[:, 1] = np.clip(edges[:, 1] + moved, 0, lowest - 2)
    edges[:, 3] = np.where(labels.cut[:, 3], lowest, np.clip(edges[:, 3] + moved, 1, lowest))
    return labels._replace(boxes=edges)


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


def _print_halves(told):
    bins, lucky = held_out(told), held_out_by_luck(told, 20)
    errors = np.array([one.error for one in bins])
    by_luck = np.array([[one.error for one in each] for each in lucky])
    for name, own in (("one half predicts the other", errors[None]), ("by luck alone", by_luck)):
        off = np.abs(own)
        print(
            f"{name}: {len(bins)} bins, off by {100 * np.sqrt(np.mean(own**2, axis=1)).mean():.1f}"
            f" points, more than 2 in {(off > 0.02).sum(axis=1).mean():.0f}, the worst by"
            f" {100 * off.max(axis=1).mean():.1f}"
        )
    for n in np.argsort(-np.abs(errors))[:5]:
        name, count, found, predicted = bins[n]
        luck = np.quantile(np.abs(by_luck[:, n]), 0.95)
        print(f"{name}: {count} labels, {found:.3f}, {predicted:.3f}, luck {luck:.3f}")


def main(stem):
    """Print the tables and draw the figure."""
    told = kitti_pictures()
    table = recall_table(told)
    for (label, level), bins in table.items():
        for middle, number, found, predicted in bins:
            print(
                f"{label}, {LEVELS[level]}, {middle:.0f} px: {number} labels,"
                f" {100 * found:.0f}% found, formula {100 * predicted:.0f}%"
            )
    seeds = [simulated(told, measured().numbers, n) for n in range(SEEDS)]
    made = [false_table(told, one, False) for one in seeds]
    both = false_table(told, told.found, True), np.mean(made, axis=0)
    print("false boxes per picture and their median score, real and simulated:")
    for label, real, simulated_ones in zip(HEIGHTS, *both, strict=True):
        print(label, real.round(3), simulated_ones.round(3))
    by_size = [sizes_of_false(told, one, False) for one in seeds]
    both = sizes_of_false(told, told.found, True), np.mean(by_size, axis=0)
    print(f"false boxes by height, between {SIZES} pixels, real and simulated:")
    for label, real, simulated_ones in zip(HEIGHTS, *both, strict=True):
        print(label, real, simulated_ones.round())
    for left_out in ((), ALL_BUT_FOOT):
        for flat in (False, True):
            real, *others = areas(told, left_out, flat)
            print(
                f"told apart, columns {left_out} left out{', flat' * flat}: real {real:.3f},"
                f" made {np.round(others, 3)}"
            )
    for how, found in street_areas().items():
        print(f"told apart on streets, {how}: {found[0]:.3f}, by the lower edge {found[1]:.3f}")
    _print_halves(told)
    save(recall_figure(table), stem)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
