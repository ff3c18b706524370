"""The categories of public 2D data sets, and which of the five classes they are."""

from collections.abc import Mapping, Sequence
from typing import Any

from care_sim.base.errors import InvalidInput, shown

CLASS_OF_NAME = {
    "person": "pedestrian",
    "pedestrian": "pedestrian",
    "human.pedestrian.adult": "pedestrian",
    "bicycle": "bicycle",
    "bike": "bicycle",
    "cyclist": "bicycle",
    "vehicle.bicycle": "bicycle",
    "vehicle.car": "car",
    "vehicle.truck": "truck",
    "vehicle.bus.rigid": "bus",
    "vehicle.bus.bendy": "bus",
    "car": "car",
    "bus": "bus",
    "truck": "truck",
}
"""Names of categories that are one of the five classes, in any of the data sets."""
_OF_COCO = ("person", "bicycle", "car", "bus", "truck")
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
            if told not in CATEGORY_MAPS:
                known = ", ".join(CATEGORY_MAPS)
                raise InvalidInput(f"unknown categories {shown(told)}; known are {known}")
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
                    f"categories must name one of {', '.join(CLASS_OF_NAME)}, got {named[:200]}"
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
        return CLASS_OF_NAME.get(name.lower()) if name else None

    @property
    def left_out(self) -> list[str]:
        """Names that are none of the five classes."""
        return [name for name in self._names.values() if name and name.lower() not in CLASS_OF_NAME]
