"""A film made by hand: a car that stands still meets five objects.

A policy that fires at the image boxes detects the car AHEAD and the BUS at the first keyframe and
the WALKER at the second. At the third appear BESIDE, a car whose image box holds the centre of the
one ahead, and BEHIND, a person whom no camera shows; and the bus, until then farther than 50 m,
enters.
"""

import numpy as np

from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES, Ego, ImageDetections
from care_sim.loops.film import Film, Shot
from care_sim.sensors.annotated import Annotations, Cloud, IdentifiedDetections
from care_sim.sensors.surround import SURROUND_CAMERAS

AHEAD, WALKER, BESIDE, BEHIND, BUS = 7, 9, 11, 13, 15
ENTRY = 2
"""The keyframe at which the bus enters."""
CAR, PERSON = (4.0, 2.0, 1.6, 0.0), (0.6, 0.6, 1.8, 0.0)
OBJECTS = {
    AHEAD: ("car", np.array([15.0, 0.0, -1.0, *CAR])),
    WALKER: ("pedestrian", np.array([20.0, 6.0, -0.9, *PERSON])),
    BESIDE: ("car", np.array([15.0, -5.0, -1.0, *CAR])),
    BEHIND: ("pedestrian", np.array([-12.0, 0.0, -0.9, *PERSON])),
    BUS: ("bus", np.array([43.5, 24.0, -0.3, 11.0, 2.5, 3.0, 0.0])),
}
"""Class and box; the bus as it stands when it enters, 49.7 m away."""
FIRST_KEYFRAMES = {AHEAD: 0, WALKER: 1, BESIDE: 2, BEHIND: 2, BUS: 0}
GRID = AngularGrid()
FRONT = SURROUND_CAMERAS[0]


def box_of(number, index=ENTRY):
    """(7,) where an object is at a keyframe."""
    box = OBJECTS[number][1].copy()
    if number == BUS:
        box[0] += 0.5 * (ENTRY - index)
    return box


def returns_of(number, index=ENTRY):
    """The cells that return from an object: all that it covers."""
    return GRID.hulls(box_of(number, index)[None], 0, 0)[0]


def image_box(number, index):
    """As the front camera sees it; the box of the car BESIDE reaches over the one AHEAD."""
    box = FRONT.project_boxes(box_of(number, index)[None])[0]
    if number == BESIDE:
        box[0] = FRONT.project_boxes(OBJECTS[AHEAD][1][None])[0, 0]
    return box


def handmade_film(keyframes=3):
    return Film(
        "handmade", SURROUND_CAMERAS, 1.84, 0.5, tuple(_shot(index) for index in range(keyframes))
    )


def _shot(index):
    present = [number for number, first in FIRST_KEYFRAMES.items() if first <= index]
    pictured = [number for number in present if number != BEHIND]
    boxes = np.array([box_of(number, index) for number in present])
    rows = [[_class(n), 0.9, *image_box(n, index), 0, 0.0, 0.0] for n in pictured]
    cells = np.concatenate([returns_of(number, index) for number in present])
    objects = np.repeat(present, [len(returns_of(number, index)) for number in present])
    order = np.argsort(cells, kind="stable")
    return Shot(
        0.5 * index,
        f"shot {index}",
        Frame(0.0, 0.0, 1.84, 0.0),
        Ego(),
        Annotations(np.array(present), np.array([_class(n) for n in present]), boxes),
        IdentifiedDetections(ImageDetections.from_rows(np.array(rows)), np.array(pictured)),
        Cloud(cells[order], 15.0 * GRID.directions[cells[order]], objects[order]),
    )


def _class(number):
    return CLASSES.index(OBJECTS[number][0])
