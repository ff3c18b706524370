"""Short scenes as a nuScenes database, which the network of `tests/helpers/pcdet` understands.

Every object returns a few points near its middle, whose intensity numbers class and object. Four
sweeps per keyframe show it moving. One object comes within range after the first keyframe.
"""

import json

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.core.frames import Frame, turned
from care_sim.core.types import CLASSES
from care_sim.sources.nuscenes.recordings import OFFICIAL
from tests.helpers.nuscenes_database import SENSORS, add_recorded_losses, annotated, pose
from tests.helpers.nuscenes_drive import CATEGORIES, SIZES
from tests.helpers.nuscenes_sweeps import write_swept

KEYFRAMES, KEYFRAME_S, SWEEPS, SWEEP_S = 3, 0.5, 4, 0.05
EGO_MPS = 8.0
POINTS = 6
SPREAD_M = 0.1
NEAR_M, FAR_M = 8.0, 40.0
COCO80 = {"pedestrian": 0, "bicycle": 1, "car": 2, "bus": 5, "truck": 7}


def write_movers(folder, count):
    """`count` scenes in `folder`: the database `DATA`, and `yolox.json` of a camera detector."""
    rng = np.random.default_rng(0)
    scenes = {name: _scene(rng) for name in OFFICIAL["val"][:count]}
    write_swept(folder / "DATA", {name: samples for name, (samples, _) in scenes.items()})
    images, found = [], []
    for name, (_, pictures) in scenes.items():
        for (keyframe, channel), boxes in pictures.items():
            images.append(
                {"id": len(images), "file_name": f"samples/{channel}/{name}-{keyframe}.jpg"}
            )
            found += [box | {"image_id": images[-1]["id"]} for box in boxes]
    told = {"annotations": found, "images": images, "categories": "coco80"}
    (folder / "yolox.json").write_text(json.dumps(told))


def _scene(rng):
    """The samples of a scene, and what its cameras see by keyframe and channel."""
    heading = rng.uniform(-np.pi, np.pi)
    objects = [_object(rng, number) for number in range(len(CLASSES))]
    samples = [_sample(rng, heading, objects, k) for k in range(KEYFRAMES)]
    pictures = {
        (k, channel): _picture(boxes, car, channel)
        for k, (boxes, car, *_) in enumerate(samples)
        for channel in SENSORS
        if channel != "LIDAR_TOP"
    }
    return samples, pictures


def _object(rng, number):
    """Class, place and velocity at the first keyframe, in the axes of the drive."""
    name = CLASSES[number]
    angle, apart = rng.uniform(-np.pi, np.pi), rng.uniform(NEAR_M, FAR_M)
    place = apart * np.array([np.cos(angle), np.sin(angle)])
    velocity = rng.uniform(-6.0, 6.0, 2)
    if name == "car":
        place = 52.0 * np.array([1.0, rng.uniform(-0.1, 0.1)])
        velocity = np.array([-4.0, 0.0])
    return name, place, velocity


def _sample(rng, heading, objects, k):
    places = [_sweep(rng, heading, objects, k * KEYFRAME_S - n * SWEEP_S) for n in range(SWEEPS)]
    (car, spots, points), earlier = places[0], places[:0:-1] if k else []
    boxes = [
        annotated(
            CATEGORIES[name], (*spot.tolist(), 1.0), SIZES[name],
            float(np.arctan2(*turned(velocity, heading)[::-1])), str(number), points=POINTS,
            attribute=_MOVING[name],
        )
        for number, ((name, _, velocity), spot) in enumerate(zip(objects, spots, strict=True))
    ]  # fmt: skip
    ago = [n * SWEEP_S for n in range(SWEEPS - 1, 0, -1)]
    swept = [(s, car, rows) for s, (car, _, rows) in zip(ago, earlier, strict=bool(k))]
    return boxes, car, points, swept


_MOVING = dict.fromkeys(("car", "truck", "bus"), "vehicle.moving") | {
    "bicycle": "cycle.with_rider",
    "pedestrian": "pedestrian.moving",
}


def _sweep(rng, heading, objects, time_s):
    """The car's pose, the objects' world places (n, 2), and the points (m, 5) of a sweep."""
    x, y = turned(np.array([EGO_MPS * time_s, 0.0]), heading).tolist()
    car = Frame(x, y, 0.0, heading)
    spots = [turned(place + velocity * time_s, heading) for _, place, velocity in objects]
    points = []
    for number, ((name, *_), spot) in enumerate(zip(objects, spots, strict=True)):
        world = np.array([*spot, 1.0]) + rng.uniform(-SPREAD_M, SPREAD_M, (POINTS, 3))
        rows = add_recorded_losses(car.vectors_to_local(world - car.origin))
        rows[:, 3] = 20 * number + CLASSES.index(name)
        points.append(rows)
    return pose(x, y, heading), spots, np.concatenate(points)


def _picture(boxes, car, channel):
    """COCO results of the objects whose middles a picture shows."""
    mount, (w, x, y, z), (focal, u, v) = SENSORS[channel]
    w_car, *_, z_car = car["rotation"]
    own = Rotation.from_quat([0.0, 0.0, z_car, w_car])
    camera = Rotation.from_quat([x, y, z, w])
    found = []
    for box in boxes:
        place = own.inv().apply(np.subtract(box["translation"], car["translation"]))
        right, down, ahead = camera.inv().apply(place - mount)
        if ahead < 1.0:
            continue
        width, _, height = np.array(box["size"]) * focal / ahead
        left, top = focal * right / ahead + u - width / 2, focal * down / ahead + v - height / 2
        if not (0 < left + width / 2 < 1600 and 0 < top + height / 2 < 900):
            continue
        (name,) = (one for one, category in CATEGORIES.items() if category == box["category"])
        found.append(
            {"category_id": COCO80[name], "bbox": [left, top, width, height], "score": 0.9}
        )
    return found
