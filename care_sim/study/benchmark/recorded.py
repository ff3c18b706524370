"""Recorded drives as worlds of B90: the parts `recorded` and `recorded ahead`, beside streets.

A policy can learn the generator of streets by heart; nobody generated a recorded drive. A drive
plays as in `care-sim protocol`: annotated boxes become bodies, rays are cast at them, the camera's
boxes are projected annotations with the errors of its profile. Its counts are those of a street.

The score is 90% on every count of every part. So B90 is that of the worst part: a policy must hold
on streets **and** on recorded drives. Within a part every object weighs alike.

- `recorded` are drives annotated all around the car: nuScenes, Argoverse 2, Boreas, and sources of
  your own. One data set here has one or two drives, too few for a part of its own, and together
  they are five: its intervals are rough. Argoverse 2 has some 30 newcomers in two drives. Boreas
  has cars almost only.
- `recorded ahead` are drives of KITTI, whose labels are of the front camera's picture. Nothing
  beside or behind the car counts there, so that a quarter of the cells is enough for all of it and
  B90 is small. A newcomer that enters the picture from the side counts as emerging. In one part
  with the others these drives, which are most, would hide what a policy misses around the car.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from care_sim.base.errors import InvalidInput
from care_sim.sources.named import replayed_source
from care_sim.sources.scenes import Scene, Source
from care_sim.study.play_config import PlayConfig, play_grid

RECORDED, AHEAD = RECORDED_PARTS = ("recorded", "recorded ahead")
LABELLED_AHEAD = ("kitti",)
"""Sources whose labels are of a front camera's picture."""


class RecordedDrive(NamedTuple):
    """A scene of a source of recordings."""

    source: Source
    scene: Scene

    @property
    def part(self) -> str:
        """Return the part of the drive."""
        return part_of(self.source.kind)

    @property
    def name(self) -> str:
        """Return SOURCE/SCENE, as result files name it: they do not say where recordings are."""
        return f"{self.source.kind}/{self.scene.name}"


def recorded_drives(sources: Sequence[str]) -> list[RecordedDrive]:
    """Return all scenes of sources by their texts, `nuscenes:FOLDER` or `boreas` for example.

    A folder of nuScenes has the scenes of its validation split. Raises InvalidInput for a text that
    names no recordings, for recordings that cannot be read, and for two drives of one name.
    """
    played = [replayed_source(text) for text in dict.fromkeys(sources)]
    drives = [RecordedDrive(source, scene) for source in played for scene in source.scenes()]
    names = [drive.name for drive in drives]
    if twice := [name for name in dict.fromkeys(names) if names.count(name) > 1]:
        raise InvalidInput(f"recorded drives must have different names, got {twice[0]} twice")
    return drives


def drive_plays(
    drives: Sequence[RecordedDrive], policy: str, budget: float = 1.0, **conditions: Any
) -> list[PlayConfig]:
    """Return the configuration of each drive, in their order. Raises InvalidInput as they do."""
    return [
        play
        for drive in drives
        for play in play_grid(drive.source, [drive.scene], [policy], [budget], **conditions)
    ]


def part_of(source: str) -> str:
    """Return the part of the drives of a source."""
    return AHEAD if source in LABELLED_AHEAD else RECORDED


def source_of_world(world: int | str) -> str:
    """Return the source in the name of a recorded world."""
    return str(world).partition("/")[0]
