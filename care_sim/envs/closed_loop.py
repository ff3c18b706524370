"""The closed-loop environments: thin Gymnasium adapters around `care_sim.loops.one_world`."""

from collections.abc import Mapping
from textwrap import indent
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_arguments, check_choice, check_number
from care_sim.core.arrays import ONE_WORLD
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.types import Action
from care_sim.driving.drivers import check_driver
from care_sim.envs import reward as rewards
from care_sim.envs.conditions_page import CONDITIONS
from care_sim.envs.sensing import Observed, SensingEnv, arguments_of, detector_of, split_conditions
from care_sim.envs.worlds import Setting, Worlds
from care_sim.loops.one_world import OneWorld
from care_sim.loops.records import Keyframe
from care_sim.perception.detectors import PROXY
from care_sim.scenarios import make_scenario, scenario_class
from care_sim.scenarios.base import Scenario
from care_sim.sensors.engines import check_engine
from care_sim.sensors.setups import DEFAULT_SETUP, Sensor, sensor_setup
from care_sim.world.world import WORLD_STEP_S, whole_steps

KEYFRAME_S = 0.1
"""Between two decisions, unless another time is given: a turn of a spinning LiDAR."""
LONGEST_KEYFRAME_S = 1.0
"""In a longer keyframe a car at 30 km/h drives more than 8 m, past what it brakes for."""


class ClosedLoopEnv(SensingEnv[OneWorld]):
    """A driving scene: the agent chooses the LiDAR's cells, and a driver brakes by fixed rules.

    ### Action
    `Box(0, 1, (E, A), float32)`: a score per cell of the grid with E rows and A columns. Each
    keyframe fires the `B` cells with the highest positive scores. Ties go to the lower cell index.
    A random floor, the same for all policies, spends the rest of the budget. `floor=False` leaves
    the rest unspent. Every action is valid, a boolean mask too, and none overspends. With another
    `firing`, scores buy whole units or several shots per cell.

    ### Observation
    A `Dict` of float32 arrays with fixed shapes. `care_sim.Belief.from_observation` reads it.

    - `ego` (3,): speed m/s (negative backwards), yaw rate rad/s, acceleration m/s^2
    - `budget` (1,): B / N, the share of cells that may fire
    - `detections` (128, 9): camera boxes; class -1 pads
    - `tracks` (256, 13): forecasts; id -1 pads
    - `ranges` (E, A): last scan, m; 0 not fired, maximum range without a return

    | column of `detections` | meaning |
    |---|---|
    | `class` | index in `care_sim.core.types.CLASSES` |
    | `confidence` | 0 to 1 |
    | `left`, `top`, `right`, `bottom` | box, pixels from the picture's upper left corner |
    | `camera` | index of the camera |
    | `age` | age of the picture, s |
    | `yaw_change` | rotation of the car since the picture, rad |

    | column of `tracks` | meaning |
    |---|---|
    | `id` | unique within an episode |
    | `class` | index in `care_sim.core.types.CLASSES` |
    | `x`, `y`, `z` | centre in the sensor frame (forward, left, up), m |
    | `length`, `width`, `height` | m |
    | `yaw` | direction of the length, from x towards y, rad |
    | `vx`, `vy` | velocity over ground along the sensor's axes, m/s; 0 after one hit |
    | `misses` | keyframes since the last detection |
    | `hits` | keyframes with a detection |

    `care_sim.loops.observation_limits` cuts longer tables and clips large numbers.

    ### Reward
    A weighted sum of the terms of `care_sim.envs.reward.Rewards`: undetected time in view,
    clearance, collision and needless braking. `reward_weights={"gain": ...}` adds the
    first-detection distance against the full-scan bound. Every term is at most 0. The reward
    contains truth: a learner may learn from it, but a policy must not read it during play.

    ### Episode end
    Terminated at a collision, or when the scenario is over. Truncated after the scenario's
    `duration_s`.

    ### Info
    Entries that a policy may read:

    - `fired`: cells of this keyframe, each as often as it fired
    - `intensities`: return strength per fired cell, 0 without a return
    - `times_s`: time per fired cell from the keyframe, s, in a rolling sweep
    - `braking`: whether the brake is on
    - `time_s`: time of the keyframe, s from the start

    The first three are arrays of length B. With `floor=False` they are lists of at most B.

    Entries for scoring alone contain truth, so a policy must not read them. `scoring_info=False`
    removes all but `outcome`. *Actor* means the first-sighting actor.

    - `detected`: whether this keyframe detected the actor
    - `in_view`: whether a faultless camera shows the actor
    - `clearance_m`: least distance from hull to hull until the next keyframe
    - `speed_mps`: true speed; the observation has the odometry's
    - `reward_terms`: `care_sim.envs.reward.Rewards`
    - `seed`: from `reset`; repeats the episode
    - `drawn`: from `reset`; scenario parameters that the seed drew, if any
    - `outcome`: at the end; a dict of `care_sim.loops.records.Outcome`

    ### Arguments
    All fields of the scenario, all conditions, and the arguments below. A forbidden value raises
    `care_sim.InvalidInput`.

    - `budget=0.10`: beta, the share of the cells that may fire, in (0, 1]
    - `sensor="hdl-32e"`: set-up, as a name, a TOML file or a `care_sim.SensorSetup`
    - `detector="returns"`: a name of `care_sim.perception.detectors.detector_names`
    - `detector_parameters=None`: a mapping of the detector's own parameters
    - `keyframe_s=0.1`: seconds between two decisions, at most 1
    - `reward_weights=None`: a mapping of changes to `care_sim.envs.reward.REWARD_WEIGHTS`
    - `render_mode=None`: None or "rgb_array"
    - `secret=False`: a text that changes everything a seed draws (`care_sim.base.seeds`)
    - `scoring_info=True`: whether `info` holds entries for scoring alone
    """

    __doc__ = f"{__doc__}{indent(CONDITIONS, '    ')}"
    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012 (Gymnasium's)
    scenario_name: str | type[Scenario]
    conditions_kind = ClosedLoopConditions

    def __init__(
        self,
        *,
        budget: float = 0.10,
        sensor: Sensor = DEFAULT_SETUP,
        detector: str = PROXY,
        detector_parameters: Mapping[str, object] | None = None,
        keyframe_s: float = KEYFRAME_S,
        reward_weights: Mapping[str, float] | None = None,
        render_mode: str | None = None,
        secret: str | bool = False,
        scoring_info: bool = True,
        **parameters: Any,
    ):
        check_number("keyframe_s", keyframe_s, WORLD_STEP_S, LONGEST_KEYFRAME_S)
        whole_steps(keyframe_s)
        check_choice("render_mode", render_mode, self.metadata["render_modes"])
        kind = scenario_class(self.scenario_name)
        check_arguments(
            type(self).__name__, parameters, [*arguments_of(type(self)), *kind.__dataclass_fields__]
        )
        conditions, physics = split_conditions(self.conditions_kind, parameters)
        check_engine(conditions.engine)
        check_driver(conditions)
        scenario = make_scenario(self.scenario_name, **physics)
        setup = sensor_setup(sensor)
        super().__init__(
            conditions,
            grid=setup.grid,
            cameras=setup.equipped(scenario.cameras),
            position=setup.position,
            budget=budget,
            keyframe_s=keyframe_s,
            secret=secret,
            scoring_info=scoring_info,
            setup=setup.label,
        )
        made = detector_of(detector, detector_parameters, conditions, self.rig)
        self.metadata = {**self.metadata, "render_fps": round(1 / keyframe_s)}
        self.render_mode = render_mode
        self.keyframes: list[Keyframe] = []
        self.setting = Setting(
            scenario,
            self.rig,
            conditions,
            # The proxy needs to know whose return each is, which the loop knows without a cloud.
            None if detector == PROXY else made,
            rewards.weights(reward_weights),
            self._secret,
            scoring_info,
        )
        self._worlds: Worlds | None = None

    @property
    def scenario(self) -> Scenario:
        """The scenario; like all of the `setting`, it stays as it was when this was made."""
        return self.setting.scenario

    @property
    def reward_weights(self) -> Mapping[str, float]:
        """The weight of every term of the reward."""
        return self.setting.weights

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observed, dict[str, Any]]:
        """Begin an episode. Scenario, camera, noise and floor have independent streams of the seed.

        `info` holds the seed that repeats the episode and the parameters that it drew, unless
        `scoring_info` is off. There are no `options`.
        """
        entropy = self._entropy(seed, options)
        self._running = None
        if self._worlds is None:
            self._worlds = Worlds([self.setting])
            self._choice = self._worlds.choice
        info = self._worlds.begin({0: entropy})[0]
        self.keyframes = []
        self._begin(OneWorld(self._worlds.loop))
        return self._observed(self._worlds), info

    def step(self, action: Action) -> tuple[Observed, float, bool, bool, dict[str, Any]]:
        """Fire the cells that `action` scores highest and advance to the next keyframe.

        Raises InvalidInput for an action of the wrong shape or with values that are not finite.
        Raises gymnasium.error.ResetNeeded before `reset`, after the end, and after an error or
        interrupt in the middle of a step.
        """
        fired, worlds = self._fired(action), self._worlds
        assert worlds is not None
        # An error leaves the world between two keyframes.
        self._over = True
        stepped = worlds.step(fired, ONE_WORLD)
        self.keyframes.append(self.loop.record(worlds.records))
        info = _first(stepped.columns) | stepped.single.get(0, {})
        terminated, truncated = bool(stepped.terminated[0]), bool(stepped.truncated[0])
        self._over = terminated or truncated
        return self._observed(worlds), float(stepped.rewards[0]), terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """A picture (H, W, 3) of the last keyframe: chase view, camera, fired cells."""
        if self.render_mode is None:
            return None
        # Imported here because most environments draw nothing.
        from care_sim.viewer.pictures.episode_view import episode_view
        from care_sim.viewer.pictures.keyframe import draw_keyframe

        return np.asarray(draw_keyframe(episode_view(self.loop, self.keyframes)))

    def close(self) -> None:
        """Free the simulator. The environment can be reset again."""
        if self._worlds is not None:
            self._worlds.close()
        self._worlds = self._running = None

    @staticmethod
    def _observed(worlds: Worlds) -> Observed:
        return {name: rows[0].copy() for name, rows in worlds.observed.items()}


def _first(columns: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers and arrays of the first world."""
    return {
        name: _first(column)
        if isinstance(column, Mapping)
        else column[0].copy()
        if column.ndim > 1
        else column[0].item()
        for name, column in columns.items()
    }
