"""The base of both loops' environments: a rig, its spaces and its budget.

No action can overspend that budget.
"""

import inspect
from collections.abc import Mapping
from typing import Any, ClassVar, Generic, TypeVar

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from care_sim.base.checks import as_array, check_flag, check_seed
from care_sim.base.errors import InvalidInput, shown
from care_sim.base.seeds import check_secret
from care_sim.core.arrays import ONE_WORLD, Floats
from care_sim.core.belief import MAX_DETECTIONS, MAX_TRACKS
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import MIN_RETURNS, Conditions
from care_sim.core.firing.listing import hardware_of
from care_sim.core.grid import Cells, Place
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.rig import Rig
from care_sim.core.types import Action
from care_sim.loops.observation_limits import Limits
from care_sim.loops.stages.choice import Choice, check_finite
from care_sim.loops.stages.state import Fired
from care_sim.loops.truth import TrueLoop, Truth
from care_sim.perception.detectors import CLUSTER, PROXY, check_detector, make_detector
from care_sim.perception.points_only import Detector
from care_sim.sensors.lidar import check_dead_rows


def observation_space(rig: Rig) -> spaces.Space[Any]:
    """The bounded observation space of a rig.

    Keys and columns are as in `care_sim.core.types`, bounds as in
    `care_sim.loops.observation_limits`.
    """
    grid = rig.grid
    limits = Limits(rig)
    return spaces.Dict(
        {
            "ego": _box(limits.ego),
            "budget": spaces.Box(0.0, 1.0, (1,), np.float32),
            "detections": _box(limits.detections, MAX_DETECTIONS),
            "tracks": _box(limits.tracks, MAX_TRACKS),
            "ranges": spaces.Box(0.0, grid.range_m, grid.shape, np.float32),
        }
    )


def checked_scores(action: NDArray[np.floating], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """As `as_scores`; raises InvalidInput also for scores that are not finite."""
    scores = as_scores(action, shape)
    check_finite(scores)
    return scores


def as_scores(action: NDArray[np.floating], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """The action as float32 scores; a boolean mask is one too. Raises InvalidInput otherwise."""
    scores = as_array("action", action)
    if scores.shape != shape:
        raise InvalidInput(f"action must have shape {shape} (rows, columns), got {scores.shape}")
    if scores.dtype.kind not in "biuf":
        raise InvalidInput(f"action must hold numbers, got {scores.dtype}")
    if scores.dtype != np.float32:
        # Overflow of float32 becomes infinite, which `check_finite` refuses.
        with np.errstate(over="ignore"):
            scores = scores.astype(np.float32)
    return scores


def _box(bounds: Floats, *rows: int) -> spaces.Box:
    """The space of numbers within `bounds` (2, k), or of so many rows of them."""
    low, high = (np.tile(bound, (*rows, 1)).astype(np.float32) for bound in bounds)
    return spaces.Box(low, high, dtype=np.float32)


def detector_of(
    name: str,
    parameters: Mapping[str, object] | None,
    conditions: Conditions,
    rig: Rig,
) -> Detector:
    """The detector `name` with its own `parameters`.

    The proxy's threshold is the condition `min_returns`. Raises InvalidInput for a name or
    parameter that is unknown, and for a `min_returns` beside another detector.
    """
    check_detector(name)
    if name != PROXY and conditions.min_returns != MIN_RETURNS:
        raise InvalidInput(f"min_returns is of the detector {PROXY}, {name} does not know it")
    if not isinstance(parameters, Mapping | None):
        raise InvalidInput(f"detector_parameters must map names to values, got {shown(parameters)}")
    if name == PROXY and "min_returns" in (parameters or {}):
        raise InvalidInput("min_returns is a condition, give it without detector_parameters")
    given: dict[str, dict[str, object]] = {
        PROXY: {"min_returns": conditions.min_returns},
        CLUSTER: {"grid": rig.grid},
    }
    return make_detector(name, rig.sensor_height_m, **given.get(name, {}) | dict(parameters or {}))


Observed = dict[str, NDArray[np.float32]]
AnyLoop = TypeVar("AnyLoop", bound=TrueLoop)
AnyConditions = TypeVar("AnyConditions", bound=Conditions)


class SensingEnv(gymnasium.Env[Observed, Action], Generic[AnyLoop]):
    """An environment whose action scores the cells of the angular grid.

    `acted` is the last action that it took: scores (E, A) of the cells, whatever wrappers made of
    it.
    """

    acted: NDArray[np.float32]
    _choice: Choice
    conditions_kind: ClassVar[type[Conditions]] = Conditions
    """The class of its conditions."""

    def __init__(
        self,
        conditions: Conditions,
        grid: Grid,
        cameras: tuple[PinholeCamera, ...],
        position: Place,
        budget: float,
        keyframe_s: float,
        secret: str | bool,
        scoring_info: bool,
        setup: str,
    ):
        check_secret(secret)
        check_flag("scoring_info", scoring_info)
        if not cameras:
            raise InvalidInput(
                "cameras must be at least one, got none: observations tell of each what it sees"
            )
        check_dead_rows(grid, conditions.lidar_dead_rows)
        if conditions.lidar_sweep_s > keyframe_s:
            raise InvalidInput(
                f"lidar_sweep_s must be at most the {keyframe_s:g} s between keyframes, got "
                f"{conditions.lidar_sweep_s:g}"
            )
        self._conditions = conditions
        self.scoring_info = scoring_info
        self._secret = secret if isinstance(secret, str) else ""
        x, y, z = position
        self._rig = Rig(
            grid=grid,
            cameras=cameras,
            budget=hardware_of(conditions.firing, grid).budget_cells(budget),
            reserve_fraction=conditions.reserve_fraction,
            keyframe_s=keyframe_s,
            azimuth_margin=conditions.azimuth_margin,
            elevation_margin=conditions.elevation_margin,
            sensor_height_m=z,
            cell_order=conditions.cell_order,
            firing=conditions.firing,
            sensor_x_m=x,
            sensor_y_m=y,
            returns=conditions.filmed,
            setup=setup,
        )
        self.action_space = spaces.Box(0.0, 1.0, grid.shape, np.float32)
        self.observation_space = observation_space(self.rig)
        self._running: AnyLoop | None = None
        self._over = False

    @property
    def rig(self) -> Rig:
        """The fixed settings of the sensing task."""
        return self._rig

    @property
    def conditions(self) -> Conditions:
        """The conditions."""
        return self._conditions

    @property
    def loop(self) -> AnyLoop:
        """The running episode. Raises gymnasium.error.ResetNeeded before the first reset."""
        if self._running is None:
            raise gymnasium.error.ResetNeeded("call reset() before stepping or rendering")
        return self._running

    @property
    def min_returns(self) -> int:
        """How many fired rays must hit an object for the proxy to detect it; with another detector,
        which does not know it, the default.
        """
        return self.conditions.min_returns

    @property
    def truth(self) -> Truth:
        """The truth that privileged policies may read; `make_policy` gives it to them alone."""
        return Truth(self)

    def _entropy(self, seed: int | None, options: dict[str, Any] | None) -> int:
        """The seed of an episode: the given one, with which the environment's own generator begins
        anew, or else a draw of that generator.

        Raises InvalidInput unless a seed is a whole number from 0 to 2^63 - 1, and for any
        `options` of `reset`: there are none.
        """
        if options:
            raise InvalidInput(
                f"reset takes no options, got {shown(options)}; what an episode is made of are "
                "arguments of the environment"
            )
        if seed is not None:
            check_seed(seed)
        return entropy_of(self, seed)

    def _begin(self, loop: AnyLoop) -> None:
        """Start an episode over a loop."""
        self._running = loop
        self._over = False

    def _fired(self, action: Action) -> Fired:
        """Take an action: the cells that it fires, until the next call.

        Raises InvalidInput for an action of the wrong shape or with values that are not finite, and
        gymnasium.error.ResetNeeded before `reset` and after the end.
        """
        keyframe = np.array([self.loop.index])
        if self._over:
            raise gymnasium.error.ResetNeeded("the episode is over: call reset()")
        # A copy, since the caller may write into an action once it is taken.
        scores = as_scores(action, self.rig.grid.shape).copy()
        fired = self._choice.fired(scores[None], ONE_WORLD, keyframe)
        self.acted = scores
        return fired

    def would_fire(self, action: Action) -> Cells:
        """The cells, ascending, that an action would fire at the coming keyframe, which it leaves
        the coming one.

        Raises InvalidInput for an action of the wrong shape or with values that are not finite.
        """
        keyframe = self.loop.index
        scores = checked_scores(action, self.rig.grid.shape)
        return self._choice.would_fire(0, scores, keyframe)


def entropy_of(env: gymnasium.Env[Any, Any], seed: int | None) -> int:
    """The seed of an episode: the given one, with which the generator of `env` begins anew, or else
    a draw of that generator.
    """
    if seed is None:
        return int(env.np_random.integers(2**32))
    gymnasium.Env.reset(env, seed=int(seed))
    return int(seed)


def split_conditions(
    kind: type[AnyConditions], parameters: Mapping[str, Any]
) -> tuple[AnyConditions, dict[str, Any]]:
    """The conditions among keyword arguments, and the other arguments.

    Raises InvalidInput for a value that is not allowed.
    """
    names = kind.__dataclass_fields__
    given = {name: value for name, value in parameters.items() if name in names}
    others = {name: value for name, value in parameters.items() if name not in names}
    return kind(**given), others


def arguments_of(kind: type[SensingEnv[Any]]) -> list[str]:
    """Return the keyword arguments of an environment's class: its own and the conditions."""
    # Each class of the family names some arguments and hands the rest on.
    made = [
        vars(one)["__init__"]
        for one in kind.__mro__
        if issubclass(one, SensingEnv) and "__init__" in vars(one)
    ]
    named = [each for make in made for each in inspect.signature(make).parameters.values()]
    # Positional ones are what a class of the family fills in for its base: cameras, keyframes.
    own = [each.name for each in named if each.kind is each.KEYWORD_ONLY]
    return [*dict.fromkeys([*own, *kind.conditions_kind.__dataclass_fields__])]


def sensing(env: gymnasium.Env[Any, Any]) -> SensingEnv[Any]:
    """The environment under the wrappers. Raises InvalidInput for one that is none of CARE-Sim."""
    inner = getattr(env, "unwrapped", None)
    if not (isinstance(env, gymnasium.Env) and isinstance(inner, SensingEnv)):
        raise InvalidInput(f"wrappers of CARE-Sim need one of its environments, got {shown(env)}")
    return inner
