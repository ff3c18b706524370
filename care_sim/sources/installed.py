"""The kinds of recordings, and sources of other packages, by an entry of the group
`care_sim.sources` or by place. Every error names its source.
"""

import inspect
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from care_sim.base.checks import check_known, check_path
from care_sim.base.errors import (
    BrokenSource,
    InvalidInput,
    MissingExtra,
    class_place,
    error_line,
    foreign_place,
    shown,
)
from care_sim.base.plugins import Plugins, dataclass_faults
from care_sim.core.conditions import RAYS, FilmedReturns
from care_sim.core.sensor_setup import SensorSetup
from care_sim.loops.film import Film
from care_sim.sources.argoverse2.recordings import Argoverse2
from care_sim.sources.boreas import Boreas
from care_sim.sources.kitti import Kitti
from care_sim.sources.nuscenes.recordings import NuScenes
from care_sim.sources.recordings import Recordings
from care_sim.sources.scenes import Generated, Recorded, Scene, Source, Streets
from care_sim.sources.sweeps.recordings import Sweeps

RECORDING_KINDS: dict[str, type[Recordings]] = {
    made.kind: made for made in (Argoverse2, NuScenes, Kitti, Sweeps, Boreas)
}
RECORDING_TEXTS = tuple(
    name if made.shipped else f"{name}:FOLDER" for name, made in RECORDING_KINDS.items()
)
"""The text of each kind."""


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


def source_faults(made: Any) -> Iterator[str]:
    """Why a loaded object is no source, one text per reason. `care_sim.base.plugins` asks it."""
    if not _is_source(made):
        yield "is neither Recordings nor Generated"
        return
    yield from dataclass_faults(made, told=("folder",))


SOURCES: Plugins[Recordings | Generated] = Plugins(
    "source",
    "care_sim.sources",
    {Streets.kind: Streets, **RECORDING_KINDS},
    source_faults,
)


def source_names() -> list[str]:
    """Names of sources: the built-in ones, then those of installed packages."""
    return SOURCES.names()


def is_source_place(place: str) -> bool:
    """Return True if a place names a class of sources, even one with faults."""
    try:
        return _is_source(replace(SOURCES, faults=lambda _: ()).maker(place))
    except InvalidInput:
        return False


def _is_source(made: Any) -> bool:
    return inspect.isclass(made) and issubclass(made, Recordings | Generated)


@dataclass(frozen=True)
class Installed:
    """The source of another package that is called `name`, in a `folder` where it has one, with
    `options` as pairs of name and value. It is known by its name, so that every process loads its
    own.

    Raises InvalidInput with the name for one that cannot be loaded or refuses folder or options;
    its methods raise BrokenSource for whatever its code raises.
    """

    name: str
    folder: str = ""
    options: tuple[tuple[str, Any], ...] = ()

    def __post_init__(self) -> None:
        try:
            SOURCES.maker(self.name)
        except InvalidInput as error:
            raise InvalidInput(f"source {self.name} cannot be loaded: {error}") from error
        with self._blamed("refuses to start"):
            self._made()

    @property
    def kind(self) -> str:
        """Return the name by which the source was chosen."""
        return self.name

    @property
    def sensor(self) -> str | SensorSetup:
        """The set-up whose grid its films hold."""
        return self._made().sensor

    def scenes(self) -> list[Scene]:
        """Its own, in order."""
        with self._blamed("lists no scenes"):
            scenes = self._made().scenes()
            names = [scene.name for scene in scenes]
            wrong = [name for name in names if not (isinstance(name, str) and name)]
            if wrong or not names or len(set(names)) < len(names):
                raise InvalidInput(
                    f"scenes must be names, at least one and each once, got {shown(names)}"
                )
        return scenes

    def film(self, scene: Scene, returns: FilmedReturns = RAYS) -> Film:
        """The film of a scene."""
        scenes = self.scenes()
        with self._blamed(f"makes no film of {scene.name}"):
            check_known("scene", scene.name, [each.name for each in scenes])
            return self._made().film(scene, returns)

    def check_returns(self, returns: FilmedReturns) -> None:
        """Recordings hold what returned, generated streets are filmed."""
        self._made().check_returns(returns)

    def files(self, scene: Scene) -> list[Path]:
        """Return the files that its class names."""
        with self._blamed(f"names no files of {scene.name}"):
            return [Path(path) for path in self._made().files(scene)]

    def log(self, scene: Scene) -> str:
        """Return the drive that its class names."""
        with self._blamed(f"names no log of {scene.name}"):
            return self._made().log(scene)

    def row(self, scene: Scene) -> dict[str, Any]:
        """Return the row of its kind, under its own name."""
        with self._blamed(f"names no files of {scene.name}"):
            return self._made().row(scene) | {"source": self.name}

    def _made(self) -> Source:
        return _source(self.name, self.folder, self.options)

    @contextmanager
    def _blamed(self, what: str) -> Iterator[None]:
        """Errors become one line that names the source."""
        try:
            yield
        except (KeyboardInterrupt, MissingExtra):
            raise
        except InvalidInput as error:
            raise InvalidInput(f"source {self.name}: {error}") from error
        # Foreign code may raise anything; some leaves by `sys.exit`.
        except BaseException as error:
            # Errors of our code come from objects that its class made.
            kind: Any = SOURCES.maker(self.name)
            place = "" if foreign_place(error) else class_place(kind)
            raise BrokenSource(f"source {self.name} {what}: {error_line(error)}{place}") from error


@lru_cache(maxsize=8)
def _source(name: str, folder: str, options: tuple[tuple[str, Any], ...]) -> Source:
    """Made once per process."""
    made: Any = SOURCES.maker(name)
    if issubclass(made, Recordings):
        if not folder:
            raise InvalidInput(f"its recordings lie in a folder: ask for {name}:FOLDER")
        return Recorded(recordings_in(made, name, folder, dict(options)))
    if folder:
        raise InvalidInput(f"it is generated and has no folder, got {shown(folder)}")
    for option, _ in options:
        if option not in {field.name for field in fields(made)}:
            raise InvalidInput(f"{option} has no meaning for {name}")
    source: Source = made(**dict(options))
    return source
