"""The categories of nuScenes and of public 2D data sets, and which of the five classes they are."""

from collections.abc import Mapping, Sequence
from typing import Any

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput, shown, unknown
from care_sim.core.types import CLASSES

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
    # Categories that nuScenes-lidarseg adds to the table.
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
_KNOWN = NUSCENES_CATEGORIES | DETECTION_NAMES
_OTHER_NAMES = {"person": "pedestrian", "cyclist": "bicycle", "bike": "bicycle"}
"""Names that other data sets have for one of the five classes."""
_NUIMAGES = (
    "car", "truck", "trailer", "bus", "construction_vehicle", "bicycle", "motorcycle",
    "pedestrian", "traffic_cone", "barrier",
)  # fmt: skip
_BDD100K = (
    "pedestrian", "rider", "car", "truck", "bus", "train", "motorcycle", "bicycle",
    "traffic light", "traffic sign",
)  # fmt: skip
CATEGORY_MAPS: dict[str, dict[int, str | None]] = {
    # Numbered with gaps up to 90, as in the official results.
    "coco": dict.fromkeys(range(1, 91))
    | {1: "person", 2: "bicycle", 3: "car", 6: "bus", 8: "truck"},
    # Numbered without gaps, as networks number their outputs.
    "coco80": dict.fromkeys(range(80))
    | {0: "person", 1: "bicycle", 2: "car", 5: "bus", 7: "truck"},
    "nuimages": dict(enumerate(_NUIMAGES)),
    "bdd100k": dict(enumerate(_BDD100K, 1)),
}
"""Categories by number: COCO (Lin et al. 2014), nuImages as mmdetection3d converts it, BDD100K as
its own tools convert it. None is a category that no class holds.
"""


class Categories:
    """Which class a numbered category is: a map of `CATEGORY_MAPS` by name, or the `categories` of
    a COCO file, a list of `id` and `name`. Raises InvalidInput for another map.
    """

    def __init__(self, told: str | Sequence[Mapping[str, Any]] = "coco"):
        if isinstance(told, str):
            check_known("map of categories", told, CATEGORY_MAPS)
            self._names: Mapping[int, str | None] = CATEGORY_MAPS[told]
            self._called = told
        else:
            try:
                self._names = {int(each["id"]): str(each["name"]) for each in told}
            except (KeyError, TypeError, ValueError) as error:
                raise InvalidInput(f"categories must be a list of id and name ({error})") from error
            self._called = "of the file"
            if not any(map(self.class_of, self._names)):
                named = ", ".join(filter(None, self._names.values()))
                raise InvalidInput(
                    f"categories must name one of {', '.join(CLASSES)}, got {named[:200]}"
                )

    def class_of(self, number: object) -> str | None:
        """The class of a category, None outside the five. Raises ValueError with the whole map for
        a number that it lacks.
        """
        if isinstance(number, bool) or not isinstance(number, int) or number not in self._names:
            listed = ", ".join(f"{n} {name}" for n, name in self._names.items() if name)
            raise ValueError(
                f"category_id {shown(number)} is none of the categories {self._called}: {listed}"
            )
        name = self._names[number]
        return _named(name) if name else None

    @property
    def left_out(self) -> list[str]:
        """Names that are none of the five classes."""
        return [name for name in self._names.values() if name and not _named(name)]


def _named(name: str) -> str | None:
    """The class of a category's name in any data set, None outside the five."""
    return (_KNOWN | _OTHER_NAMES).get(name.lower())


class UnknownCategory(InvalidInput):
    """A name that is neither a category of nuScenes nor one of its detection task."""


def class_of(name: str) -> str | None:
    """The class of a category or of a name of the detection task, None outside the five.

    Raises UnknownCategory for any other name.
    """
    if name not in _KNOWN:
        raise UnknownCategory(str(unknown("category", name, _KNOWN)))
    return _KNOWN[name]
