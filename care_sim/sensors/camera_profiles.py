"""Named camera detectors: the numbers by which each finds objects and errs.

`yolox` is measured on published detections of YOLOX on the 21 training drives of KITTI's tracking
benchmark, beside KITTI's labels. Pictures have 1242 x 375 pixels, a focal length of 721.5 pixels,
10 per second. Source: the repository of DeepFusionMOT (Wang et al., RA-L 2022),
`data/detections/2D/yolox/train` at commit 832ab54. Least confidence 0.5 of pedestrians and 0.3 of
cars. A label counts as found if a box of its class overlaps it by an IoU of 0.5. How each number
was read, and what is assumed: `docs/camera.md`.
"""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.conditions import YOLOX_CAMERA, CameraFaults
from care_sim.core.types import CLASSES


@dataclass(frozen=True)
class RecallTable:
    """Measured recall at some heights and visible shares, linear between them.

    `heights` (h,) in pixels and `shares` (s,) ascend; `recalls` (s, h). Recall falls to 0 from the
    first height to height 0 and from the first share to share 0; beyond the last ones it stays.
    """

    heights: tuple[float, ...]
    shares: tuple[float, ...]
    recalls: tuple[tuple[float, ...], ...]

    def at(self, heights: Floats, shares: Floats) -> Floats:
        """(n,) the recall at `heights` (n,) in pixels and visible `shares` (n,)."""
        known = (0.0, *self.heights)
        by_height = [np.interp(heights, known, (0.0, *row)) for row in self.recalls]
        levels = np.stack([np.zeros(len(heights)), *by_height])
        # Where each share lies between two of the table: the lower one, and how far beyond it.
        places = np.interp(shares, (0.0, *self.shares), np.arange(len(levels)))
        lower = np.minimum(places.astype(np.int64), len(levels) - 2)
        objects = np.arange(len(heights))
        low, high = levels[lower, objects], levels[lower + 1, objects]
        recalls: Floats = low + (places - lower) * (high - low)
        return recalls


@dataclass(frozen=True)
class GroupProfile:
    """Numbers of a group of classes.

    `miss_time_s` is the correlation time of its misses. `jitter` are spreads, relative to the box:
    its middle across and down, and the logarithms of its width and height.
    """

    recall: RecallTable
    miss_time_s: float
    jitter: tuple[float, float, float, float]


@dataclass(frozen=True)
class CameraProfile:
    """A detector. Heights are in pixels of the focal length `focal_px`. `group_of` (5,) is the
    place in `groups` of every class. `confusion` maps (true, reported) class names to the share of
    found objects that are so confused. `ghosts_per_picture` false boxes are there on the mean; one
    is in the next picture, dt later, too with the chance exp(-dt / `ghost_time_s`).
    """

    focal_px: float
    groups: tuple[GroupProfile, ...]
    group_of: tuple[int, ...]
    jitter_time_s: float
    confusion: tuple[tuple[str, str, float], ...]
    confusion_time_s: float
    ghosts_per_picture: float
    ghost_time_s: float

    def groups_of(self, classes: Integers) -> Integers:
        """(n,) the group of each of `classes` (n,)."""
        return np.array(self.group_of, np.int64)[classes]

    def confusion_matrix(self) -> Floats:
        """(5, 5) the chances that a found object of the class of a row is reported as that of a
        column.
        """
        matrix = np.eye(len(CLASSES))
        for true, reported, share in self.confusion:
            row = CLASSES.index(true)
            matrix[row, CLASSES.index(reported)] += share
            matrix[row, row] -= share
        return matrix


_SHARES = (0.3, 0.6, 1.0)
"""The visible shares that KITTI's levels stand for: 2 largely, 1 partly and 0 not occluded. They
are the means over the labels of what nearer labelled boxes leave visible: 0.31, 0.60 and 0.97, the
last rounded up, since level 0 is what nothing hides."""
_PEOPLE = GroupProfile(
    RecallTable(
        (39.0, 53.0, 70.0, 96.0, 160.0),
        _SHARES,
        (
            (0.16, 0.25, 0.26, 0.31, 0.54),
            (0.43, 0.53, 0.66, 0.73, 0.79),
            (0.66, 0.80, 0.88, 0.94, 0.95),
        ),
    ),
    miss_time_s=0.22,
    jitter=(0.12, 0.023, 0.15, 0.038),
)
"""Read off KITTI's pedestrians; bicycles are taken to be like them."""
_VEHICLES = GroupProfile(
    RecallTable(
        (17.0, 25.0, 55.0),
        _SHARES,
        (
            (0.56, 0.60, 0.61),
            (0.93, 0.92, 0.87),
            (0.96, 0.98, 0.98),
        ),
    ),
    miss_time_s=0.65,
    jitter=(0.029, 0.036, 0.056, 0.051),
)
"""Read off KITTI's cars; trucks and buses are taken to be like them."""

YOLOX = CameraProfile(
    focal_px=721.5,
    groups=(_VEHICLES, _PEOPLE),
    group_of=tuple(int(name in ("bicycle", "pedestrian")) for name in CLASSES),
    jitter_time_s=1.6,
    # Shares of the labels of KITTI's cyclists that lie under a box of a pedestrian, and of its vans
    # and trucks under one of a car, taken for shares of the found, and so too low.
    confusion=(("bicycle", "pedestrian", 0.20), ("truck", "car", 0.19)),
    confusion_time_s=1.0,
    # Boxes that touch no label and no region that KITTI left unlabelled, and how many pictures the
    # same one stays: of pedestrians 0.09 per picture for 1.7, of cars 0.19 for 2.1; 1.95 on the
    # mean of both. A life of n pictures, dt = 0.1 s apart, on the mean: T = -dt / ln(1 - 1 / n).
    ghosts_per_picture=0.28,
    ghost_time_s=0.14,
)


def invents_boxes(faults: CameraFaults) -> bool:
    """Whether the camera reports false boxes, or ghosts, that need a pool to be made from."""
    return faults.false_positive_rate > 0 or faults.camera_profile == YOLOX_CAMERA
