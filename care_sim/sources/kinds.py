"""The kinds of recordings, and recordings by a text, such as `argoverse2:FOLDER`."""

import os
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

from care_sim.base.checks import check_path
from care_sim.base.errors import InvalidInput, shown
from care_sim.sources.argoverse2.recordings import Argoverse2
from care_sim.sources.boreas import Boreas
from care_sim.sources.kitti import Kitti
from care_sim.sources.nuscenes.recordings import NuScenes
from care_sim.sources.recordings import Recordings
from care_sim.sources.sweeps.recordings import Sweeps

RECORDING_KINDS: dict[str, type[Recordings]] = {
    made.kind: made for made in (Argoverse2, NuScenes, Kitti, Sweeps, Boreas)
}
RECORDING_TEXTS = tuple(
    name if made.shipped else f"{name}:FOLDER" for name, made in RECORDING_KINDS.items()
)
"""How each kind is asked for."""


def recordings(text: str, options: Mapping[str, object] | None = None) -> Recordings:
    """The recordings that a text `KIND:FOLDER` names, or `KIND` where they come with the package,
    with the `options` of their kind; those that are None are not given. Raises InvalidInput for
    another text, a folder that is none, an option that the kind does not have.
    """
    kind, colon, folder = text.partition(":") if isinstance(text, str) else ("", "", "")
    made = RECORDING_KINDS.get(kind)
    if made is not None and made.shipped and not colon:
        return recordings_in(made, kind, str(made.shipped), options or {})
    if made is None or made.shipped or not folder:
        raise InvalidInput(
            f"source must be {', '.join(RECORDING_TEXTS)}, or one of your own, MODULE:CLASS, got "
            f"{shown(text)}"
        )
    return recordings_in(made, kind, folder, options or {})


def recordings_in(
    kind: type[Recordings], name: str, folder: str, options: Mapping[str, object]
) -> Recordings:
    """The recordings of a kind, called by `name`, in a folder, with those of the `options` that are
    not None. Raises InvalidInput for a folder that is none, an option that the kind does not have.
    """
    check_path("source", folder)
    folder = os.path.expanduser(folder)
    is_file = os.path.isfile(folder) and folder.endswith(kind.suffixes)
    if not (os.path.isdir(folder) or is_file):
        files = "".join(f" and no {suffix} file" for suffix in kind.suffixes)
        raise InvalidInput(f"source {name}:{folder}: {folder} is no folder{files}")
    given = {name: value for name, value in options.items() if value is not None}
    for option in given:
        if option not in {field.name for field in fields(kind)}:
            raise InvalidInput(f"{option} has no meaning for {name} recordings")
    if "camera_detections" in given:
        check_path("camera_detections", given["camera_detections"])
        given["camera_detections"] = Path(os.path.expanduser(str(given["camera_detections"])))
    for option in {"split", "version"} & set(given):
        if not isinstance(given[option], str):
            raise InvalidInput(f"{option} must be a name, got {shown(given[option])}")
    return kind(Path(folder), **given)
