"""The conditions of an environment: how well the car senses, who drives it, and how its budget is
spent.

The fields are at once keyword arguments of the environments, options of the command line and
columns of the results. Every fault is off by default. Their bounds are far beyond what any sensor
does.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from care_sim.base.checks import LARGEST_INTEGER, bounded, check_fields, check_whole, one_of
from care_sim.base.errors import InvalidInput, shown
from care_sim.base.times import LAST_BITS_S
from care_sim.core.cells.rays import MOST_COLUMNS, MOST_ROWS
from care_sim.core.defaults import (
    AS_DEMANDED,
    AZIMUTH_MARGIN,
    CELL_ORDERS,
    CELLS,
    ELEVATION_MARGIN,
    RESERVE_FRACTION,
)

FIXED, CAREFUL_HUMAN = DRIVERS = "fixed", "careful-human"


@dataclass(frozen=True, kw_only=True)
class DriverSettings:
    """The driver by name, and the rules of the fixed one with their sources.

    `careful-human` has the numbers of its regulation; of these it takes `comfort_mps2` alone.
    """

    driver: str = one_of(FIXED, DRIVERS)
    """The driver that brakes: `fixed`, the controller of `care_sim.driving.braking`, or
    `careful-human`, the driver model of UN Regulation 157 (`care_sim.driving.drivers`).
    """
    brake_mps2: float = bounded(5.0, 0.1, 20)
    """Deceleration b, m/s^2; UN Regulation 152 requires at least 5 of emergency braking."""
    brake_reaction_s: float = bounded(0.3, 0, 10)
    """From decision to full braking, seconds: build-up of brake pressure."""
    brake_standstill_m: float = bounded(2.0, 0, 50)
    """s_0, jam distance of the intelligent driver model (Treiber et al. 2000), metres, as in the
    guard of SBF.
    """
    brake_horizon_s: float = bounded(2.0, 0, 10)
    """How far ahead an entry is predicted, seconds: the two-second rule (Vogel 2003), as in the
    guard of SBF.
    """
    brake_side_margin_m: float = bounded(0.3, 0, 5)
    """Room kept on either side of the ego, metres."""
    brake_release_s: float = bounded(0.5, 0, 60)
    """The way must have been free this long before the brake is released, seconds."""
    brake_for_oncoming: bool = False
    """Whether a track that comes towards the ego counts where it will be, not where it is
    (`care_sim.driving.braking`). In the Euro NCAP tests it always does.
    """
    comfort_mps2: float = bounded(1.5, 0.01, 10)
    """Acceleration back to cruising speed, m/s^2."""


DRIVER_SETTINGS = tuple(field.name for field in fields(DriverSettings))
BRAKING_RULES = tuple(name for name in DRIVER_SETTINGS if name.startswith("brake_"))
"""Settings that the fixed controller alone knows."""


STRONGEST, LAST, BOTH = "strongest", "last", "both"
RETURNS_KEPT = (STRONGEST, LAST, BOTH)
"""Which echoes of a beam a sensor reports."""
_NEEDS = {
    "lidar_stated_reflectance": "lidar_stated_range_m",
    "visibility_m": "lidar_stated_range_m",
    "rain_mm_h": "lidar_stated_range_m",
    "lidar_returns": "lidar_divergence_mrad",
    "lidar_compensated": "lidar_sweep_s",
}
"""Settings that say nothing unless another one is switched on."""
_LEAST_M = 0.01
"""Metres. The formulas divide by a range and by a visibility: nearer to 0 they would overflow."""


@dataclass(frozen=True, kw_only=True)
class ReturnSettings:
    """Effects on a LiDAR's pulses on their way there and back, one switch for each.

    Every switch is off by default: then each fired cell returns what its ray meets within reach.
    The formulas lie in `care_sim.sensors`, each with its source; `docs/returns.md` shows them
    together. Raises InvalidInput for a value out of its bounds
    and for a setting that has no meaning without another one.
    """

    lidar_stated_range_m: float = bounded(0.0, 0, 10_000)
    """From here a target of `lidar_stated_reflectance` that faces the LiDAR returns just enough, in
    clear air, metres, 0.01 at least: a line of every data sheet. A return is then as strong as its
    surface and its distance make it (`care_sim.sensors.signal`), and weaker ones are lost. At 0
    none is.
    """
    lidar_stated_reflectance: float = bounded(0.1, 0.001, 1)
    """Reflectance of the target at `lidar_stated_range_m`, 0 to 1; most data sheets take 0.1."""
    visibility_m: float = bounded(0.0, 0, 1_000_000)
    """Meteorological visibility in fog, metres, 0.01 at least (`care_sim.sensors.signal`); 0 is
    clear air. The cameras see on as before.
    """
    rain_mm_h: float = bounded(0.0, 0, 1000)
    """Rain, millimetres per hour (`care_sim.sensors.signal`). The cameras see on as before."""
    lidar_divergence_mrad: float = bounded(0.0, 0, 100)
    """Angle between opposite edges of a beam, milliradians (`care_sim.sensors.beams`). A beam may
    then meet several bodies. At 0 it is one ray.
    """
    lidar_returns: str = one_of(STRONGEST, RETURNS_KEPT)
    """Which echo a beam returns that has several: `strongest`, `last` or `both`
    (`care_sim.sensors.signal`).
    """
    lidar_sweep_s: float = bounded(0.0, 0, 1)
    """How long a sweep takes, seconds: columns fire one after another, the last at the keyframe
    (`care_sim.sensors.beams`). At 0 all fire at once.
    """
    lidar_compensated: bool = False
    """Whether points of a sweep are moved by how the ego moved since. Ranges stay as measured."""
    lidar_crosstalk: float = bounded(0.0, 0, 1)
    """Share of the cells that take the pulse of another LiDAR for their return, 0 to 1
    (`care_sim.sensors.lidar`).
    """

    def __post_init__(self) -> None:
        check_fields(self)
        self.check_returns()

    @property
    def shapes_beams(self) -> bool:
        """Whether the returns of a cell need more than one ray."""
        return bool(self.lidar_stated_range_m or self.lidar_divergence_mrad or self.lidar_sweep_s)

    def check_returns(self) -> None:
        """Raise InvalidInput for a setting that has no meaning without another one, and for a
        distance too near to 0.
        """
        changed = [n for n, usual in RETURN_SETTINGS.items() if getattr(self, n) != usual]
        for name in ("lidar_stated_range_m", "visibility_m"):
            if 0 < getattr(self, name) < _LEAST_M:
                raise InvalidInput(
                    f"{name} must be 0 or at least {_LEAST_M:g}, got {getattr(self, name):g}"
                )
        for name in changed:
            if (needed := _NEEDS.get(name, name)) not in changed:
                raise InvalidInput(f"{name} has no meaning without {needed}")


RETURN_SETTINGS: dict[str, Any] = {field.name: field.default for field in fields(ReturnSettings)}
"""Their names and defaults."""


@dataclass(frozen=True, kw_only=True)
class FilmedReturns(ReturnSettings):
    """How pulses return in a film, without crosstalk, which is drawn when it is played. It holds
    what returns to a cell that is fired up to `most_shots` times. With `clutter` its street is less
    clean.
    """

    most_shots: int = 1
    clutter: bool = False


RAYS = FilmedReturns()
"""All switches off."""


def changed_settings(settings: FilmedReturns, usual: FilmedReturns) -> list[str]:
    """The names of the conditions in which two differ."""
    names = (*RETURN_SETTINGS, "clutter")
    return [name for name in names if getattr(settings, name) != getattr(usual, name)]


MIN_RETURNS = 3
"""Fired rays that must hit an object. The fewest that span a surface."""
BEFORE, COMING = SWEEP_MASKS = "before", "coming"
"""Which mask the sweeps between two keyframes fire."""
IDEAL_CAMERA, YOLOX_CAMERA, KITTI_CAMERA = CAMERA_PROFILES = "ideal", "yolox", "kitti"
"""The camera that reports whatever shows enough pixels, and two that err as measured."""
CAMERA_CONFIDENCE = 0.25
"""The public confidence threshold of the paper's camera detector (Remark 2)."""
MOST_FALSE_BOXES = 64
"""False detections per picture, on average: half as many as a policy is shown at most."""
MOST_KEYFRAMES = 1200
"""No fault needs to last longer: a minute in steps of 0.05 s, as long as an episode may be."""
LONGEST_LATENCY_S = 60.0
"""As long as `MOST_KEYFRAMES`."""
LONGEST_BLACKOUT_S = 3600.0
"""Latest begin and longest time of a blackout: far beyond the end of any episode or scene."""

MOST_VELOCITY_KEYFRAMES = 20
"""Two seconds of the closed loop: nobody in traffic keeps a velocity for longer."""

LONGEST_CORRELATION_S = 1e6
"""Longer than any drive: over a minute such an error walks by 1% of its spread."""


@dataclass(frozen=True, kw_only=True)
class CameraFaults:
    """Errors of the camera."""

    camera_profile: str = one_of(IDEAL_CAMERA, CAMERA_PROFILES)
    """The detector that the camera is like: `ideal`, or `yolox`
    (`care_sim.sensors.camera_profiles`) or `kitti` (`care_sim.sensors.kitti`), which miss, confuse
    and invent objects as two detectors were measured to. The faults below come on top.
    """
    false_negative_rate: float = bounded(0.0, 0, 1)
    """Share of the objects in a picture that the camera misses, 0 to 1."""
    false_negative_per_m: float = bounded(0.0, 0, 1)
    """How much that share grows with every metre of distance, up to 1."""
    false_negative_burst: int = bounded(1, 1, MOST_KEYFRAMES)
    """Keyframes that a miss lasts; the share of misses stays what it is."""
    false_positive_rate: float = bounded(0.0, 0, MOST_FALSE_BOXES)
    """Mean number of boxes per picture that show nothing. Each by itself is much like a true one.
    They are drawn from true ones (`care_sim.sensors.false_boxes`), so there are none where the
    camera never sees anybody.
    """
    camera_latency: int = bounded(0, 0, MOST_KEYFRAMES)
    """Age of the camera's detections in whole keyframes."""
    camera_latency_s: float = bounded(0.0, 0, LONGEST_LATENCY_S)
    """Age of the camera's detections in seconds; not together with `camera_latency`. The picture is
    of that instant, or of the newest earlier one that has a picture. The closed loop has one per
    step of 0.05 s, a film one per keyframe (`care_sim.sensors.camera`).
    """
    camera_jitter: int = bounded(0, 0, MOST_KEYFRAMES)
    """Most keyframes by which a picture may come later still; drawn evenly from 0 to this."""
    blackout_start_s: float = bounded(0.0, 0, LONGEST_BLACKOUT_S)
    """When the camera goes black, seconds from the start; only with `blackout_s`."""
    blackout_s: float = bounded(0.0, 0, LONGEST_BLACKOUT_S)
    """How long the camera's pictures are black, seconds."""
    camera_rotation_sigma_deg: float = bounded(0.0, 0, 180)
    """Spread of the error in yaw and pitch with which the camera is mounted, degrees; drawn once
    per episode.
    """
    camera_position_sigma_m: float = bounded(0.0, 0, 10)
    """Spread of the error in x, y and z with which the camera is mounted, metres; drawn once per
    episode.
    """

    def _check_latency(self) -> None:
        if self.camera_latency and self.camera_latency_s:
            raise InvalidInput(
                "give camera_latency (keyframes) or camera_latency_s (seconds), not both"
            )

    def black_at(self, time_s: float) -> bool:
        """Whether a picture taken at `time_s` is black."""
        begin = self.blackout_start_s - LAST_BITS_S
        end = self.blackout_start_s + self.blackout_s - LAST_BITS_S
        return begin <= time_s < end


@dataclass(frozen=True, kw_only=True)
class LidarFaults:
    """Errors of the LiDAR."""

    lidar_range_sigma: float = bounded(0.0, 0, 50)
    """Gaussian noise on every range, metres, folded back at 0 and at the reach. Policies meet it;
    the proxy detector does not, since its boxes are true.
    """
    lidar_dropout: float = bounded(0.0, 0, 1)
    """Share of returns that are lost, 0 to 1."""
    lidar_dead_rows: tuple[int, ...] = ()
    """Elevation rows that fire and return nothing; row 0 is the highest."""

    def _check_rows(self) -> None:
        rows: Any = self.lidar_dead_rows
        if not (
            isinstance(rows, list | tuple) or (isinstance(rows, np.ndarray) and rows.ndim == 1)
        ):
            raise InvalidInput(f"lidar_dead_rows must be a list of rows, got {shown(rows)}")
        for row in rows:
            check_whole("lidar_dead_rows", row, 0, MOST_ROWS)
        # Conditions that mean the same must be equal: they are part of what identifies an episode.
        object.__setattr__(self, "lidar_dead_rows", tuple(sorted({int(row) for row in rows})))


@dataclass(frozen=True, kw_only=True)
class Sensing(CameraFaults, LidarFaults, ReturnSettings):
    """How well the car senses: engine, thresholds, which pulses return, and everything that
    degrades camera, LiDAR and odometry.
    """

    ego_speed_sigma: float = bounded(0.0, 0, 10)
    """Gaussian noise on the car's own speed as policy and controller read it, m/s; it never changes
    the sign. The acceleration beside it is exact.
    """
    ego_position_sigma_m: float = bounded(0.0, 0, 50)
    """Spread of the error in x and in y of where the car takes itself to be, metres. Tracks are
    kept in that frame, and so is the way that the car is to go."""
    ego_yaw_sigma_deg: float = bounded(0.0, 0, 180)
    """Spread of the error in the heading of that pose, degrees."""
    ego_pose_correlation_s: float = bounded(0.0, 0, LONGEST_CORRELATION_S)
    """How long these errors last, seconds (`care_sim.driving.localisation`): 0 draws them anew at
    every keyframe, a time far beyond the episode lets them walk at random."""
    engine: str = "fast"
    """The engine that casts the rays and draws the pictures of the closed loop: `fast`, which is
    compiled, or `bullet`, PyBullet's own and the reference.
    """
    min_returns: int = bounded(MIN_RETURNS, 1, LARGEST_INTEGER)
    """Fired rays that must hit an object for it to be detected."""
    velocity_keyframes: int = bounded(2, 2, MOST_VELOCITY_KEYFRAMES)
    """Detections through which the tracker lays a straight line of least squares, for place and
    velocity of a track (`care_sim.perception.tracker`). 2 takes both as detected. More smooth the
    errors of a measured detector, and follow later who starts or brakes: with 10 the car hits a
    leading car that brakes (`results/detectors.md`).
    """
    sweep_mask: str = one_of(BEFORE, SWEEP_MASKS)
    """Mask of the sweeps between two keyframes, in a film that has sweeps. `before` fires the cells
    of the last keyframe, the only mask chosen by then. `coming` fires those of the next keyframe,
    as if one mask covered all sweeps of a keyframe.
    """
    clutter: bool = False
    """Whether a generated street is less clean; only films of streets have this. It adds kerbs,
    verges, vegetation, poles, uneven fronts, bicycles in racks and people in groups
    (`care_sim.streets.clutter`). The road slopes, and returns are lost and err as in recorded
    sweeps (`care_sim.sensors.recorded_errors`).
    """
    camera_confidence: float = bounded(CAMERA_CONFIDENCE, 0, 1)
    """Least confidence of a camera detection, 0 to 1; visible pixels decide, and the least box has
    0.25 (`care_sim.sensors.pictures`).
    """

    def __post_init__(self) -> None:
        check_fields(self)
        self._check_latency()
        self._check_rows()
        self.check_returns()


@dataclass(frozen=True, kw_only=True)
class Conditions(Sensing):
    """The conditions of both loops: sensing, and how the budget is spent.

    `care_sim.core.rig.Rig` checks what the allocator is given; the environments check whether
    engine and rows exist.
    """

    reserve_fraction: float = bounded(RESERVE_FRACTION, 0, 1)
    """Share rho of the budget that the allocator keeps for the reserve, 0 to 1."""
    floor: bool = True
    """Whether the shared random floor spends what the policy leaves of the budget."""
    floor_seed: int = bounded(0, 0, LARGEST_INTEGER)
    """Which of the random floors that the episode's seed holds."""
    azimuth_margin: int = bounded(AZIMUTH_MARGIN, 0, MOST_COLUMNS)
    """Columns by which hulls and wedges are dilated."""
    elevation_margin: int = bounded(ELEVATION_MARGIN, 0, MOST_ROWS)
    """Rows by which hulls and wedges are dilated."""
    cell_order: str = one_of(AS_DEMANDED, CELL_ORDERS)
    """In which order the cells of a set are taken: `as-demanded`, which for the paper's policies is
    row by row from the top, `rows-down`, `rows-up`, `columns`, `random`, `spread` or
    `core-spread`.
    """
    firing: str = CELLS
    """The hardware, which limits what the LiDAR can fire (`care_sim.core.firing`): `cells`,
    `tiles:ROWSxCOLUMNS`, `segments:COLUMNS`, `rows`, `columns`, `vertical-window`,
    `azimuth-window:DEGREES` or `energy:SHOTS`.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        # Conditions that mean the same must be equal: they are part of what identifies an episode.
        if self.firing != CELLS:
            # Imported here because hardware needs grids, which load SciPy and Numba.
            from care_sim.core.firing.listing import settled

            object.__setattr__(self, "firing", settled(self.firing))

    @property
    def filmed(self) -> FilmedReturns:
        """How pulses return, as a film is made with it."""
        from care_sim.core.firing.listing import most_shots

        told = {name: getattr(self, name) for name in RETURN_SETTINGS}
        told["lidar_crosstalk"] = RETURN_SETTINGS["lidar_crosstalk"]
        # Without strength, more shots return nothing else.
        shots = most_shots(self.firing) if self.lidar_stated_range_m else 1
        return FilmedReturns(**told, most_shots=shots, clutter=self.clutter)


@dataclass(frozen=True, kw_only=True)
class ClosedLoopConditions(DriverSettings, Conditions):
    """All conditions: those of both loops, and the driver, which only the closed loop has. Raises
    InvalidInput for a `sweep_mask` and for `clutter`, which films alone have.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.sweep_mask != BEFORE:
            raise InvalidInput(
                "sweep_mask is of films: a keyframe of the closed loop is one sweep, fired by its "
                "own mask"
            )
        if self.clutter:
            raise InvalidInput("clutter is of films of generated streets: no other world has it")


DEFAULTS = {field.name: field.default for field in fields(ClosedLoopConditions)}
OF_BOTH_LOOPS = tuple(field.name for field in fields(Conditions))
LOCALISATION = ("ego_position_sigma_m", "ego_yaw_sigma_deg", "ego_pose_correlation_s")
COLUMNS_WHERE_CHANGED = (
    *DRIVER_SETTINGS,
    *RETURN_SETTINGS,
    *LOCALISATION,
    "firing",
    "camera_profile",
    "camera_latency_s",
    "sweep_mask",
    "clutter",
    "velocity_keyframes",
)
"""Conditions that become a column of results only if they differ from the default. Rows and their
digests therefore stay as they were before the condition existed."""
CAMERA_FAULTS = tuple(field.name for field in fields(CameraFaults))
UNUSED_BY_FULL_SCAN = (
    *CAMERA_FAULTS,
    "camera_confidence",
    "reserve_fraction",
    "floor",
    "floor_seed",
    "azimuth_margin",
    "elevation_margin",
    "cell_order",
    "firing",
    "sweep_mask",
)
"""Conditions that change nothing for a scan of every cell: it asks neither the camera nor the
allocator."""
