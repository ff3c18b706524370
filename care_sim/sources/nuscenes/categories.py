"""Which categories of nuScenes the five classes hold."""

from care_sim.types import CLASSES

CATEGORIES = {
    "human.pedestrian.adult": "pedestrian",
    "human.pedestrian.child": "pedestrian",
    "human.pedestrian.construction_worker": "pedestrian",
    "human.pedestrian.police_officer": "pedestrian",
    "vehicle.bicycle": "bicycle",
    "vehicle.bus.bendy": "bus",
    "vehicle.bus.rigid": "bus",
    "vehicle.car": "car",
    "vehicle.truck": "truck",
}
"""As the official detection task maps them; every other category lies outside."""


def class_of(name: str) -> str | None:
    """The class of a category, or of a class by its own name; None outside the five."""
    return name if name in CLASSES else CATEGORIES.get(name)
