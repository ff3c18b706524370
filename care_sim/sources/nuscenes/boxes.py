"""The annotated boxes of nuScenes: as annotations, as bodies, and how visible they are."""

from collections.abc import Sequence

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.core.frames import Frame
from care_sim.core.types import CLASSES
from care_sim.sensors.annotated import NO_OBJECT, Annotations
from care_sim.sources.boxes_as_bodies import AnnotatedBody
from care_sim.sources.nuscenes.cameras import VISIBLE_SHARES
from care_sim.sources.nuscenes.categories import UnknownCategory, class_of
from care_sim.sources.nuscenes.mounts import frame_of
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.sources.nuscenes.tables import Database
from care_sim.sources.plausible import AWAY_M, SIZES_M


def class_name(database: Database, box: JsonRow) -> str | None:
    """The class of a box, None outside the five."""
    token = database.row("instance", box["instance_token"])["category_token"]
    try:
        return class_of(database.row("category", token)["name"])
    except UnknownCategory as error:
        raise InvalidInput(f"{database.path('category')}: {token!r}: {error}") from None


def object_numbers(database: Database, samples: list[JsonRow]) -> dict[str, int]:
    """A number for every instance of a scene."""
    tokens = {
        box["instance_token"] for sample in samples for box in database.annotations(sample["token"])
    }
    # Sorted: the order of a set differs from process to process.
    return {token: number for number, token in enumerate(sorted(tokens))}


def annotations_of(
    database: Database, boxes: Sequence[JsonRow], numbers: dict[str, int], sensor: Frame
) -> Annotations:
    """Boxes of the five classes as annotations in the frame of the LiDAR.

    Raises InvalidInput for a box farther from it than any recording has one.
    """
    frames = [frame_of(database, "sample_annotation", box) for box in boxes]
    rows = [
        (*frame.origin.tolist(), *_size(database, box), frame.yaw)
        for frame, box in zip(frames, boxes, strict=True)
    ]
    classes = [CLASSES.index(str(class_name(database, box))) for box in boxes]
    objects = [numbers[box["instance_token"]] for box in boxes]
    local = sensor.boxes_to_local(np.array(rows).reshape(-1, 7))
    for box, place in zip(boxes, local[:, :3], strict=True):
        _check_near(database, box, place)
    return Annotations(np.array(objects, dtype=np.int64), np.array(classes, dtype=np.int64), local)


def body_of(
    database: Database, box: JsonRow, numbers: dict[str, int], sensor: Frame
) -> AnnotatedBody:
    """A box of any category as a body, seen from the LiDAR."""
    frame = sensor.seeing(frame_of(database, "sample_annotation", box))
    _check_near(database, box, frame.origin)
    label = class_name(database, box)
    number = NO_OBJECT if label is None else numbers[box["instance_token"]]
    return AnnotatedBody(number, label, _size(database, box), frame)


def visible_shares(database: Database, boxes: Sequence[JsonRow]) -> Floats:
    """(n,) the share of each object that its level of visibility stands for; 1 without a level."""
    return np.array([_share(database, box["visibility_token"]) for box in boxes])


def _check_near(database: Database, box: JsonRow, place: Floats) -> None:
    away = np.abs(place).max()
    if away > AWAY_M[1]:
        raise InvalidInput(
            f"{database.path('sample_annotation')}: {box['token']!r} lies {away:g} m from the "
            f"LiDAR, may lie {AWAY_M[1]:g} m from it"
        )


def _size(database: Database, box: JsonRow) -> tuple[float, float, float]:
    """Length, width and height; the table has width, length, height."""
    width, length, height = database.numbers(
        "sample_annotation", box, "size", 3, within=SIZES_M
    ).tolist()
    return length, width, height


def _share(database: Database, token: str) -> float:
    if not token:
        return 1.0
    level = database.row("visibility", token)["level"]
    if level not in VISIBLE_SHARES:
        known = ", ".join(VISIBLE_SHARES)
        raise InvalidInput(
            f"{database.path('visibility')}: {token!r} has the unknown level {level!r}; known: "
            f"{known}"
        )
    return VISIBLE_SHARES[level]
