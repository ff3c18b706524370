"""Which categories of nuScenes the five classes hold."""

from care_sim.base.errors import InvalidInput, unknown

NUSCENES_CATEGORIES: dict[str, str | None] = {
    "human.pedestrian.adult": "pedestrian",
    "human.pedestrian.child": "pedestrian",
    "human.pedestrian.construction_worker": "pedestrian",
    "human.pedestrian.police_officer": "pedestrian",
    "vehicle.bicycle": "bicycle",
    "vehicle.bus.bendy": "bus",
    "vehicle.bus.rigid": "bus",
    "vehicle.car": "car",
    "vehicle.truck": "truck",
    # Outside the five classes.
    "animal": None,
    "human.pedestrian.personal_mobility": None,
    "human.pedestrian.stroller": None,
    "human.pedestrian.wheelchair": None,
    "movable_object.barrier": None,
    "movable_object.debris": None,
    "movable_object.pushable_pullable": None,
    "movable_object.trafficcone": None,
    "static_object.bicycle_rack": None,
    "vehicle.construction": None,
    "vehicle.emergency.ambulance": None,
    "vehicle.emergency.police": None,
    "vehicle.motorcycle": None,
    "vehicle.trailer": None,
    # What nuScenes-lidarseg adds to the table.
    "flat.driveable_surface": None,
    "flat.other": None,
    "flat.sidewalk": None,
    "flat.terrain": None,
    "noise": None,
    "static.manmade": None,
    "static.other": None,
    "static.vegetation": None,
    "vehicle.ego": None,
}
"""The class of every category, None outside the five: as the official detection task maps them."""

DETECTION_NAMES: dict[str, str | None] = {
    **{name: name for name in ("bicycle", "bus", "car", "pedestrian", "truck")},
    **dict.fromkeys(("barrier", "construction_vehicle", "motorcycle", "traffic_cone", "trailer")),
}
"""The same for the names of the official detection task."""


class UnknownCategory(InvalidInput):
    """A name that is neither a category of nuScenes nor one of its detection task."""


def class_of(name: str) -> str | None:
    """The class of a category or of a name of the detection task, None outside the five.

    Raises UnknownCategory for any other name.
    """
    known = NUSCENES_CATEGORIES | DETECTION_NAMES
    if name not in known:
        raise UnknownCategory(str(unknown("category", name, known)))
    return known[name]
