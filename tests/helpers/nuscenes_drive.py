"""Two drives past objects of all five classes, some of which move, as a nuScenes database."""

import numpy as np

from care_sim.core.frames import Frame, turned
from tests.helpers.nuscenes_database import add_recorded_losses, annotated, pose, write

SPLIT = {"scene-0103": 0.0, "scene-0916": 2.2}
"""The heading of each drive; both are scenes of the official validation split."""
KEYFRAMES = 5
SPEED = 4.0
"""Speed of the car, metres per keyframe."""
SIZES = {
    "car": (1.9, 4.6, 1.7),
    "truck": (2.5, 7.0, 2.9),
    "bus": (2.9, 11.0, 3.4),
    "bicycle": (0.6, 1.8, 1.4),
    "pedestrian": (0.7, 0.7, 1.8),
}
"""Width, length and height in metres."""
CATEGORIES = {
    "car": "vehicle.car",
    "truck": "vehicle.truck",
    "bus": "vehicle.bus.rigid",
    "bicycle": "vehicle.bicycle",
    "pedestrian": "human.pedestrian.adult",
}
OBJECTS = [
    ("car", (30.0, 4.0), (0.0, 0.0), 0.2, "vehicle.parked"),
    ("car", (38.0, -3.5), (-6.0, 0.5), 3.1, "vehicle.moving"),
    ("truck", (26.0, -9.0), (0.0, 0.0), -0.1, "vehicle.parked"),
    ("bus", (33.0, 12.0), (4.0, 0.0), 0.0, "vehicle.moving"),
    ("bicycle", (24.0, -5.0), (0.0, 0.0), 1.5, "cycle.without_rider"),
    ("pedestrian", (22.0, 6.5), (0.0, -1.2), -1.6, "pedestrian.moving"),
    ("pedestrian", (28.0, 7.5), (0.0, 0.0), 0.0, "pedestrian.standing"),
]
"""Class, place at the start, velocity (m/s), heading and attribute; axes x along the drive, y to
its left.
"""
POINTS = 60
"""In every box, a return each."""


def write_drive(root):
    """The folder of the database."""
    return write(root, {name: samples(heading) for name, heading in SPLIT.items()})


def samples(heading):
    rng = np.random.default_rng(0)
    return [sample(heading, n, rng) for n in range(KEYFRAMES)]


def sample(heading, number, rng):
    x, y = turned(np.array([SPEED * number, 0.0]), heading).tolist()
    boxes = [placed(heading, number, n, *thing) for n, thing in enumerate(OBJECTS)]
    car = Frame(x, y, 0.0, heading)
    points = [in_box(box, rng) for box in boxes]
    return (
        boxes,
        pose(x, y, heading),
        add_recorded_losses(car.vectors_to_local(np.concatenate(points) - car.origin)),
    )


def placed(heading, number, instance, name, place, velocity, yaw, attribute):
    spot = turned(np.add(place, np.multiply(velocity, 0.5 * number)), heading)
    size = SIZES[name]
    centre = (*spot.tolist(), size[2] / 2)
    return annotated(
        CATEGORIES[name], centre, size, heading + yaw, f"{name}-{instance}", "4", POINTS, attribute
    )


def in_box(box, rng):
    """(POINTS, 3) world points spread over a box."""
    width, length, height = box["size"]
    w, _, _, z = box["rotation"]
    spread = rng.uniform(-0.49, 0.49, (POINTS, 3)) * (length, width, height)
    return turned(spread, 2 * np.arctan2(z, w)) + box["translation"]
