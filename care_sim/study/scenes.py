"""The scenes of the protocol by a text: generated streets, or recordings in a folder."""

import hashlib
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from care_sim.errors import InvalidInput, unknown
from care_sim.sources.recordings import KINDS, NuScenes, Recordings, recordings
from care_sim.streets.street import CALIBRATION_SEEDS, EVALUATION_SEEDS, street_name


class Scene(NamedTuple):
    """A scene by name, and the seed that its environment is reset with."""

    name: str
    seed: int


class Source(Protocol):
    """Where scenes come from. Hashable."""

    def scenes(self) -> list[Scene]:
        """All of them, in order. Raises InvalidInput where they cannot be listed."""
        ...

    def environment(self, scene: Scene) -> tuple[str, dict[str, Any]]:
        """The id of a scene's environment and the arguments that choose the scene."""
        ...

    def row(self) -> dict[str, Any]:
        """Columns that name the source, wherever its files lie."""
        ...


@dataclass(frozen=True)
class Streets:
    """Generated streets: the 150 of the evaluation, or the 20 of the calibration."""

    split: str = "evaluation"

    def scenes(self) -> list[Scene]:
        """One a seed."""
        return [Scene(street_name(seed), seed) for seed in SPLITS[self.split]]

    def environment(self, scene: Scene) -> tuple[str, dict[str, Any]]:
        """The seed chooses the street."""
        return "CARE-Street-v0", {}

    def row(self) -> dict[str, Any]:
        """Streets have one source."""
        return {"source": "streets"}


@dataclass(frozen=True)
class Recorded:
    """Scenes of recordings; `text` names them as on the command line."""

    text: str
    recordings: Recordings

    def scenes(self) -> list[Scene]:
        """By name; one seed for all, since the name of a scene is part of what draws its faults and floor."""
        return [Scene(name, 0) for name in self.recordings.scenes()]

    def environment(self, scene: Scene) -> tuple[str, dict[str, Any]]:
        """The name chooses the scene."""
        options = {name: value for name, value in asdict(self.recordings).items() if name != "folder"}
        return "CARE-Replay-v0", {"source": self.text, "scene": scene.name, **options}

    def row(self) -> dict[str, Any]:
        """The kind of recordings, and a hash of the file of camera detections where there is one."""
        own = {"source": self.recordings.kind}
        if isinstance(self.recordings, NuScenes) and self.recordings.camera_detections:
            own["camera_detections"] = _content_hash(self.recordings.camera_detections)
        return own


SPLITS = {"evaluation": EVALUATION_SEEDS, "calibration": CALIBRATION_SEEDS}


def source_of(text: str, **options: object) -> Source:
    """The source that a text names: `streets`, `argoverse2:FOLDER` or `nuscenes:FOLDER`, with `options` of its kind
    (`split`, and those of `care_sim.sources.recordings.NuScenes`); those that are None are not given.

    Raises InvalidInput for another text, a folder that is none, an option that the kind does not have.
    """
    if text != "streets":
        if text.partition(":")[0] not in KINDS:
            known = ", ".join(["streets", *(f"{kind}:FOLDER" for kind in KINDS)])
            raise InvalidInput(f"unknown source {text!r}; known: {known}")
        return Recorded(text, recordings(text, options))
    given = {name: value for name, value in options.items() if value is not None}
    split = str(given.pop("split", "evaluation"))
    if given:
        raise InvalidInput(f"{', '.join(given)} says nothing to streets")
    if split not in SPLITS:
        raise unknown("split of the streets", split, SPLITS)
    return Streets(split)


def chosen(scenes: list[Scene], names: tuple[str, ...]) -> list[Scene]:
    """The scenes that are asked for: one whole number means that many, from the first; else scenes by name; all of
    them without. Raises InvalidInput for a name or a number that there is not.
    """
    if not names:
        return scenes
    if len(names) == 1 and names[0].isdigit():
        if not 1 <= int(names[0]) <= len(scenes):
            raise InvalidInput(f"scenes must be a number from 1 to {len(scenes)} or names, got {names[0]}")
        return scenes[: int(names[0])]
    known = {scene.name: scene for scene in scenes}
    for name in names:
        if name not in known:
            raise unknown("scene", name, known)
    return [known[name] for name in dict.fromkeys(names)]


@lru_cache(maxsize=1)
def _content_hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
