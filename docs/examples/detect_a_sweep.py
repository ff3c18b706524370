"""A detector on a sweep of your own LiDAR: prints what it finds, and draws it from above.

    python docs/examples/detect_a_sweep.py SWEEP.pcd.bin out.png      # a sweep of nuScenes

The detector `pillars` learned from generated streets alone. Other formats: change `points_of`.
"""

import sys

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from care_sim.core.types import CLASSES
from care_sim.perception.pillars.detector import PillarsDetector

HEIGHT_M = 1.84  # of the LiDAR above the road
REACH_M = 50.0
COLOURS = ("tab:orange", "tab:red", "tab:purple", "tab:green", "tab:blue")


def points_of(path: str) -> np.ndarray:
    """(P, 3) points with x forward, y left, z up: the LiDAR of nuScenes has x to the right."""
    x, y, z, _, _ = np.fromfile(path, np.float32).reshape(-1, 5).T
    return np.stack([y, -x, z], axis=1).astype(float)


def corners(box: np.ndarray) -> np.ndarray:
    """(4, 2) the corners of a box in plan."""
    x, y, _, length, width, _, yaw = box
    along = np.array([np.cos(yaw), np.sin(yaw)]) * length / 2
    across = np.array([-np.sin(yaw), np.cos(yaw)]) * width / 2
    ways = [(1, 1), (1, -1), (-1, -1), (-1, 1)]
    return np.array([[x, y] + a * along + b * across for a, b in ways])


def main(path: str, picture: str) -> None:
    """Detect, count and draw."""
    points = points_of(path)
    found = PillarsDetector().detect(points, HEIGHT_M)
    near = np.hypot(*found.boxes[:, :2].T) <= REACH_M
    found = found.take(near)
    for label, name in enumerate(CLASSES):
        print(f"{name:12} {np.sum(found.classes == label)}")

    figure = Figure(figsize=(8, 8), layout="constrained")
    axes = figure.subplots()
    # Heights above the road, in grey: what is higher is darker.
    axes.scatter(
        -points[:, 1], points[:, 0], s=0.4, c=points[:, 2] + HEIGHT_M, cmap="Greys", vmin=-1, vmax=2
    )
    for label, box, score in zip(found.classes, found.boxes, found.scores, strict=True):
        places = corners(box)[:, ::-1] * [-1, 1]
        axes.add_patch(Polygon(places, fill=False, color=COLOURS[label], linewidth=1.4))
        axes.annotate(f"{score:.2f}", places[0], color=COLOURS[label], size=7)
    for label, name in enumerate(CLASSES):
        axes.plot([], [], color=COLOURS[label], label=name)
    axes.set(xlim=(-REACH_M, REACH_M), ylim=(-REACH_M, REACH_M), aspect="equal")
    axes.set(xlabel="to the right (m)", ylabel="ahead (m)")
    axes.legend(loc="upper right")
    figure.savefig(picture, dpi=150)


if __name__ == "__main__":
    main(*sys.argv[1:])
