"""Where the sensors of all worlds are, and what their software takes pose and motion to be."""

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask, places
from care_sim.core.conditions import Sensing
from care_sim.core.rig import Rig
from care_sim.core.types import Ego
from care_sim.driving.localisation import Localisation, Odometry
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.stages.state import Sensors, State


class Locating:
    """Places the sensors at every keyframe, and reads the odometry. `limits` (2, 3) are the bounds
    of speed, yaw rate and acceleration in an observation.
    """

    def __init__(self, rig: Rig, sensing: Sensing, limits: Floats, state: State):
        self._rig = rig
        self._sensing = sensing
        self._limits = limits
        x, y, z = map(float, rig.sensor_position)
        self._at, self._middle = (x, y, z), (x, 0.0, z)
        self._errs = bool(sensing.ego_position_sigma_m or sensing.ego_yaw_sigma_deg)
        self._localisations: dict[int, Localisation] = {}
        self._odometers: dict[int, Odometry] = {}
        # One table serves all three where nothing sets them apart.
        if self._errs:
            state.taken = state.driven = Sensors.of(state.worlds)
        if y:
            state.driven = Sensors.of(state.worlds)

    def begin(self, world: int, seeds: SensorSeeds) -> None:
        """Begin the episode of a world."""
        if self._errs:
            self._localisations[world] = Localisation(
                self._sensing, self._rig.keyframe_s, seeds.odometry
            )
        if self._sensing.ego_speed_sigma:
            self._odometers[world] = Odometry(self._sensing.ego_speed_sigma, seeds.odometry)

    def look(self, state: State) -> None:
        """Locate the sensors of the live worlds at their coming keyframe."""
        placed = state.bodies.boxes, state.egos.bodies, state.live
        place_sensors(state.sensors, *placed, self._at)
        if state.driven is not state.taken:
            place_sensors(state.driven, *placed, self._middle)
        if self._errs:
            self._err(state)
        egos = state.egos
        moving = np.array([egos.speeds, egos.yaw_rates, egos.accelerations]).T
        if self._sensing.ego_speed_sigma:
            for world in places(state.live):
                moved = Ego(*moving[world].tolist())
                moving[world, 0] = self._odometers[world].reading(moved).speed
        np.clip(moving, *self._limits, out=state.read, where=state.live[:, None])

    def place(self, state: State, due: Mask) -> None:
        """Put the sensors of the worlds that are `due` where they are now, between keyframes."""
        place_sensors(state.sensors, state.bodies.boxes, state.egos.bodies, due, self._at)
        for world in places(due & self._errs):
            taken_for = self._localisations[world].taken_for(state.sensors.frame(world))
            state.taken.put(world, taken_for)

    def _err(self, state: State) -> None:
        """Put the sensors where the software takes them to be."""
        for world in places(state.live):
            localisation = self._localisations[world]
            localisation.advance()
            if state.driven is not state.taken:
                middle = state.driven.frame(world)
                state.driven.put(world, localisation.taken_for(middle))
            state.taken.put(world, localisation.taken_for(state.sensors.frame(world)))


def place_sensors(
    sensors: Sensors, boxes: Floats, egos: Integers, live: Mask, at: tuple[float, float, float]
) -> None:
    """Write where the sensors of the worlds are that are `live` (W,). They are mounted `at`
    (x, y, z) on the bodies `egos` (W,), and `boxes` (W, B, 7) are those of all bodies.
    """
    yaws = boxes[np.arange(len(egos)), egos, 6]
    # The sines and cosines are NumPy's, as in `care_sim.core.frames`.
    turns = np.cos(yaws), np.sin(yaws), np.cos(-yaws), np.sin(-yaws)
    _place(boxes, egos, live, at, *turns, *sensors)


@compiled(brief=True)
def _place(
    boxes: Floats,
    egos: Integers,
    live: Mask,
    at: tuple[float, float, float],
    cosines: Floats,
    sines: Floats,
    back_cosines: Floats,
    back_sines: Floats,
    poses: Floats,
    turns: Floats,
    turns_back: Floats,
) -> None:
    """See `place_sensors`."""
    ahead, left, height = at
    for w in range(len(egos)):
        if not live[w]:
            continue
        box = boxes[w, egos[w]]
        cos, sin = turns[w, 0], turns[w, 1] = cosines[w], sines[w]
        turns_back[w, 0], turns_back[w, 1] = back_cosines[w], back_sines[w]
        poses[w, 0] = box[0] + (cos * ahead - sin * left)
        poses[w, 1] = box[1] + (sin * ahead + cos * left)
        poses[w, 2], poses[w, 3] = height, box[6]
