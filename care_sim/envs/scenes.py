"""The environments of the open loop by id: generated streets and recorded scenes."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

from care_sim.base.errors import InvalidInput, shown
from care_sim.envs.open_loop import FilmEnv, OpenLoopEnv, check_film_arguments
from care_sim.envs.sensing import Observed
from care_sim.perception.detectors import PROXY
from care_sim.sensors.setups import DEFAULT_SETUP, Sensor, sensor_setup
from care_sim.sensors.surround import SURROUND_CAMERAS
from care_sim.sources.feeding import source_for
from care_sim.sources.named import replayed_source
from care_sim.sources.scenes import Scene, film_of
from care_sim.sources.street_films import check_filmed, street_film
from care_sim.streets.draft import STREET_KEYFRAME_S


class StreetEnv(OpenLoopEnv):
    """`CARE-Street-v0`: a generated urban street, 40 keyframes at 2 Hz, six cameras around the car.

    The seed of `reset` draws the street and all faults. A `secret` gives unpublished streets.
    `sensor` sets LiDAR and cameras, as in the closed loop.
    """

    __doc__ = f"{__doc__}\n    {OpenLoopEnv.__doc__}"

    def __init__(self, *, sensor: Sensor = DEFAULT_SETUP, **parameters: Any):
        self._setup = setup = sensor_setup(sensor)
        cameras = setup.equipped(SURROUND_CAMERAS)
        mounted = setup.grid, cameras, setup.position
        super().__init__(*mounted, STREET_KEYFRAME_S, setup.label, **parameters)
        check_filmed(self.conditions.filmed)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin an episode in the street of a seed.

        `info` holds what repeats it; there are no `options`.
        """
        entropy = self._entropy(seed, options)
        film = street_film(entropy, self._secret, self._setup, self.conditions.filmed)
        return self._start(film, entropy)


class ReplayEnv(FilmEnv):
    """`CARE-Replay-v0`: a recorded scene, at 2 Hz.

    `source` names the recordings: `boreas`, `argoverse2:FOLDER`, `nuscenes:FOLDER`,
    `kitti:FOLDER`, `sweeps:FOLDER` or a source of your own (`care_sim.sources.named`). `scene`
    names a scene, by default the first one. `sensor` is the set-up that sees the boxes of Boreas
    and KITTI, or that recorded the sweeps. `reference` and `topics` belong to
    `care_sim.sources.sweeps.recordings.Sweeps`, the other arguments to
    `care_sim.sources.nuscenes.recordings.NuScenes`. Missing or damaged files raise
    `care_sim.InvalidInput`. The seed of `reset` draws faults, noise and floor.
    """

    __doc__ = f"{__doc__}\n    {OpenLoopEnv.__doc__}"

    def __init__(
        self,
        *,
        source: str = "",
        scene: str | None = None,
        split: str | None = None,
        version: str | None = None,
        camera_detections: str | PathLike[str] | None = None,
        sweeps: int | None = None,
        camera_times: str | None = None,
        empty_boxes: bool | None = None,
        sensor: Sensor | None = None,
        reference: str | None = None,
        topics: Sequence[str] | None = None,
        **parameters: Any,
    ):
        # Before the scene is read, so that a wrong name is refused at once.
        check_film_arguments(type(self), parameters)
        if not isinstance(scene, str | None):
            raise InvalidInput(f"scene must be a name, got {shown(scene)}")
        recorded = replayed_source(
            source,
            split=split,
            version=version,
            camera_detections=camera_detections,
            sweeps=sweeps,
            camera_times=camera_times,
            empty_boxes=empty_boxes,
            sensor=sensor,
            reference=reference,
            topics=topics,
        )
        told = parameters.get("detector_parameters") or {}
        # Other parameters than a map are refused below.
        if isinstance(told, Mapping):
            recorded = source_for(recorded, parameters.get("detector", PROXY), told, sweeps)
        scenes = recorded.scenes()
        # The source refuses a name that it does not have.
        named = (each for each in scenes if each.name == scene)
        wanted = scenes[0] if scene is None else next(named, Scene(scene, 0))
        super().__init__(film_of(recorded, wanted), **parameters)
