"""Campaign: random calls of the public interface, with values that nobody asked for.

A call must return, or raise what `judge.call` allows. What returns has to be sound: observations
lie in their space, rewards are finite and at most 0, no more cells fire than may, none twice.

Doors (making, resetting, stepping, policies, beliefs, allocation, configurations) are given
anything at all. The arithmetic of grid and tables is given arrays of the shape that it asks for,
with any numbers in them.
"""

from contextlib import suppress
from dataclasses import MISSING, fields
from functools import lru_cache, partial
from numbers import Real
from warnings import catch_warnings, simplefilter

import numpy as np

from tests.torture import hostile, judge
from tests.torture.case import DONE, Fault

LIMIT_S = 10.0
MORE = ("reward_weights", "render_mode", "keyframe_s", "budget", "seed", "self", "unknown")


def prepare(_name):
    good_observation()


def play(case):
    action = case.rng.choices(list(ACTIONS), list(ACTIONS.values()))[0]
    case.tell(action.__name__)
    with catch_warnings():
        simplefilter("error", RuntimeWarning)
        try:
            action(case)
        except Fault:
            raise
        except Exception as error:
            return judge.call(error)
    return DONE


@lru_cache(maxsize=1)
def good_env():
    import gymnasium

    import care_sim  # noqa: F401

    env = gymnasium.make("CARE-Dense-v0", budget=0.05, duration_s=1.0)
    env.reset(seed=0)
    return env


@lru_cache(maxsize=1)
def good_observation():
    """An observation amid an episode, with tracks and detections."""
    env = good_env()
    for _ in range(4):
        observation = env.step(np.zeros((32, 512), np.float32))[0]
    return observation


def told(value):
    """A value for the notes."""
    with suppress(Exception):
        return ascii(value)[:300]
    return f"a {type(value).__name__}"


def draw(case, known, most=3):
    """Arguments by name: `known` maps names to makers of values that fit, None where only hostile
    ones are drawn.
    """
    rng, drawn = case.rng, {}
    for name in rng.sample(sorted(known), rng.randint(0, min(most, len(known)))):
        fitting = known[name]
        drawn[name] = fitting() if fitting and rng.random() < 0.4 else hostile.objects(rng)
    case.tell(
        f"arguments {{{', '.join(f'{name}={told(value)}' for name, value in drawn.items())}}}"
    )
    return drawn


def some(case, *fitting):
    """A value: one of the fitting, or a hostile one."""
    value = (
        case.rng.choice(fitting)
        if fitting and case.rng.random() < 0.4
        else hostile.objects(case.rng)
    )
    case.tell(f"value {told(value)}")
    return value


def _fields_of(kind):
    """The fields of a dataclass, with makers of their defaults."""
    return {
        one.name: (lambda one=one: one.default) if one.default is not MISSING else None
        for one in fields(kind)
    }


def environment(case):
    """Make an environment, reset it, take a few steps."""
    import gymnasium

    from care_sim.core.conditions import ClosedLoopConditions
    from care_sim.envs import CLOSED_LOOP
    from care_sim.scenarios import SCENARIOS

    name = case.rng.choice([*CLOSED_LOOP])
    case.tell(name)
    scenario = SCENARIOS[name.split("-")[1].lower()]
    known = _fields_of(ClosedLoopConditions) | _fields_of(scenario) | dict.fromkeys(MORE)
    make = partial(gymnasium.make, name, disable_env_checker=case.rng.random() < 0.7)
    if case.rng.random() < 0.5:
        make = gymnasium.envs.registration.load_env_creator(gymnasium.spec(name).entry_point)
    with make(**draw(case, known)) as env:
        _played(case, env)


def street(case):
    """The same with a generated street, of which few are drawn: they take a moment."""
    import gymnasium

    from care_sim.core.conditions import Conditions

    extra = (
        "detector",
        "detector_parameters",
        "render_mode",
        "budget",
        "keyframe_s",
        "source",
        "unknown",
    )
    arguments = draw(case, _fields_of(Conditions) | dict.fromkeys(extra))
    with gymnasium.make("CARE-Street-v0", disable_env_checker=True, **arguments) as env:
        if case.rng.random() < 0.2:
            _played(case, env)


def replay(case):
    """Recorded scenes, from texts that name none."""
    import gymnasium

    known = dict.fromkeys(
        (
            "source",
            "scene",
            "split",
            "version",
            "camera_detections",
            "sweeps",
            "sensor",
            "reference",
            "topics",
            "detector",
            "budget",
            "unknown",
        )
    )
    known["source"] = lambda: case.rng.choice(
        ("argoverse2:.", "nuscenes:.", "argoverse2:", "nuscenes:/nowhere", "sweeps:.", ":")
    )
    gymnasium.make("CARE-Replay-v0", disable_env_checker=True, **draw(case, known)).close()


def _played(case, env):
    seed = some(case, 0, 1, 2, None)
    observation, _ = env.reset(seed=seed, options=case.rng.choice((None, {}, {"a": 1}, "x", 5)))
    check_observation(env, observation)
    for _ in range(case.rng.randrange(4)):
        observation, reward, terminated, truncated, info = env.step(_action(case))
        check_observation(env, observation)
        if not (np.isfinite(reward) and reward <= 0) and "reward_weights" not in " ".join(
            case.steps
        ):
            raise Fault("a reward that is not finite and at most 0", repr(reward))
        _check_cells(info["fired"], env.unwrapped.rig.budget, env.unwrapped.rig.grid.size)
        if terminated or truncated:
            break
    env.render()


def _action(case):
    rng = case.rng
    good = np.random.default_rng(rng.randrange(9)).random((32, 512), np.float32)
    kind = rng.randrange(9)
    if kind == 0:
        good[rng.randrange(32), rng.randrange(512)] = rng.choice(
            (np.nan, np.inf, -np.inf, 1e30, -1.0, 5e-45)
        )
    actions = {
        1: good > 0.9,
        2: np.zeros((32, 512)),
        3: good.tolist(),
        4: good[:, ::-1],
        5: good.astype(object),
    }
    action = actions.get(kind, good if kind < 8 else hostile.objects(rng))
    case.tell(f"action {kind} {told(action)}")
    return action


def check_observation(env, observation):
    space = env.observation_space
    for name, value in getattr(space, "spaces", {}).items():
        if not value.contains(observation[name]):
            given, low, high = observation[name], value.low, value.high
            wrong = (
                np.argwhere(~((given >= low) & (given <= high)))[:3].tolist()
                if given.shape == low.shape
                else "shape"
            )
            values = (
                [float(given[tuple(index)]) for index in wrong] if wrong != "shape" else given.shape
            )
            column = wrong[0][-1] if wrong and wrong != "shape" else ""
            raise Fault(
                "an observation outside its space", f"{wrong} {values}", f"{name}, column {column}"
            )


def _check_cells(cells, budget, size):
    cells = np.asarray(cells)
    if (
        len(cells) > budget
        or len(np.unique(cells)) < len(cells)
        or (len(cells) and not 0 <= cells.min() <= cells.max() < size)
    ):
        raise Fault(
            "cells beyond the budget, twice or outside the grid",
            f"{len(cells)} of {budget}: {cells[:5]}",
        )


def policy(case):
    """Make a policy and ask it."""
    from care_sim.policies import BUILT_IN, make_policy, maker, policy_names
    from care_sim.policies.makers import settable

    name = case.rng.choice([*policy_names(), some(case)])
    with suppress(TypeError):
        case.tell(name)
    env = good_env() if case.rng.random() < 0.9 else some(case)
    make = maker(name) if isinstance(name, str) and name in BUILT_IN else None
    known = {one.name: None for one in settable(make)} if make else {}
    made = make_policy(
        name, env, **draw(case, known | dict.fromkeys(("path", "k_safe", "unknown")))
    )
    made.reset()
    action = made(_observation(case))
    if action.shape != (32, 512) or not np.isfinite(action).all():
        raise Fault("an action that is none", str(action))


def _observation(case):
    """One of the environments', with something wrong in it; or something else."""
    rng = case.rng
    observation = {name: value.copy() for name, value in good_observation().items()}
    name = rng.choice(sorted(observation))
    change = rng.choice((*_CHANGES, None))
    case.tell(f"observation, {name}: {change.__name__ if change else 'as it is'}")
    if change is some:
        return some(case)
    if change:
        observation[name] = change(case, observation[name])
    return {key: value for key, value in observation.items() if value is not _GONE}


_GONE = object()


def _gone(_case, _value):
    return _GONE


def _anything(case, _value):
    return some(case)


def _of_another_type(case, value):
    return value.astype(case.rng.choice((np.float64, np.int64, complex, object, str)))


def _odd_number(case, value):
    flat = value.reshape(-1)
    flat[case.rng.randrange(min(flat.size, 90))] = case.rng.choice(
        (np.nan, np.inf, -np.inf, 1e30, -1e30, 1e9, -7, 99)
    )
    return value


def _half(_case, value):
    return value[: len(value) // 2]


def _deeper(_case, value):
    return value[..., None]


def _as_list(_case, value):
    return value.tolist()


_CHANGES = (
    _gone,
    _anything,
    _of_another_type,
    _odd_number,
    _odd_number,
    _odd_number,
    _half,
    _deeper,
    _as_list,
    some,
)


def belief(case):
    """Read an observation back."""
    from care_sim.core.belief import Belief

    Belief.from_observation(_observation(case)).to_observation()


def allocation(case):
    """Algorithm 1."""
    from care_sim.core.allocation import allocate
    from care_sim.core.types import Demand

    rng = case.rng

    def cells():
        fitting = np.array([rng.randrange(16384) for _ in range(rng.randrange(60))], int)
        return fitting if rng.random() < 0.8 else some(case)

    def sets():
        return [cells() for _ in range(rng.randrange(4))] if rng.random() < 0.8 else some(case)

    layers = [sets() for _ in range(rng.randrange(3))] if rng.random() < 0.8 else some(case)
    demand = Demand(sets(), layers) if rng.random() < 0.95 else some(case)
    budget, share = some(case, 0, 10, 100, 1638), some(case, 0.0, 0.3, 1.0)
    floor = some(case, None, range(200), np.random.default_rng(0).permutation(16384))
    chosen = allocate(demand, budget, share, floor)
    if len(chosen) > budget or len(set(chosen.tolist())) < len(chosen):
        raise Fault(
            "an allocation beyond the budget, or of a cell twice", f"{len(chosen)} of {budget}"
        )


def rig(case):
    """The rig, and what it covers."""
    from care_sim.core.grid import AngularGrid
    from care_sim.core.rig import Rig
    from care_sim.sensors.pictures import FRONT_CAMERA

    known = _fields_of(Rig) | {"grid": AngularGrid, "cameras": lambda: (FRONT_CAMERA,)}
    made = Rig(**draw(case, known))
    made.hulls(_boxes(case))
    made.grid.wedges(_bundles(case), made.azimuth_margin, made.elevation_margin)
    _ = made.camera_models


def _boxes(case):
    boxes = np.tile([10.0, 1.0, -1.0, 4.0, 2.0, 1.5, 0.1], (3, 1))
    boxes[case.rng.randrange(3), case.rng.randrange(7)] = case.rng.choice(
        (0, -1, 1e9, 1e30, np.nan, np.inf, 1e-30, 5)
    )
    return boxes if case.rng.random() < 0.9 else boxes[:0]


def _bundles(case):
    bundles = np.random.default_rng(case.rng.randrange(99)).normal(size=(2, 5, 3))
    bundles[case.rng.randrange(2), case.rng.randrange(5)] = case.rng.choice(
        (0, 1e300, np.nan, np.inf, 1e-300, 5)
    )
    return bundles


def grid(case):
    """The angular grid and its cells."""
    from care_sim.core.grid import AngularGrid

    made = AngularGrid(**draw(case, _fields_of(AngularGrid)))
    if (
        isinstance(made.columns, int)
        and isinstance(made.rows, int)
        and abs(made.columns * made.rows) > 2**24
    ):
        return  # honest work
    made.cells_of(_bundles(case)[0])
    made.hulls(_boxes(case), case.rng.choice((0, 2, 99, 10**6)), case.rng.choice((0, 1, 99)))
    made.wedges(_bundles(case))
    _ = made.directions, made.fan, made.size


def scenario(case):
    """A scenario, and a world of it."""
    from care_sim.scenarios import SCENARIOS, make_scenario

    name = case.rng.choice(list(SCENARIOS)) if case.rng.random() < 0.95 else some(case)
    case.tell(told(name))
    known = _fields_of(SCENARIOS[name]) if isinstance(name, str) and name in SCENARIOS else {}
    make_scenario(name, **draw(case, known | {"unknown": None})).build(
        np.random.default_rng(0)
    ).close()


def conditions(case):
    """The conditions alone."""
    from care_sim.core.conditions import ClosedLoopConditions

    ClosedLoopConditions(**draw(case, _fields_of(ClosedLoopConditions), 5))


def wrapper(case):
    """Wrappers around an environment, or around something else."""
    from care_sim import wrappers

    name = case.rng.choice(
        ("GridObservation", "SectorReserve", "SectorScores", "RecordRerun", "ExportScans")
    )
    case.tell(name)
    env = good_env() if case.rng.random() < 0.9 else some(case)
    arguments = {
        "GridObservation": ("columns", "rows", "pictures"),
        "RecordRerun": ("path", "policy", "name"),
        "ExportScans": ("path", "policy"),
    }.get(name, ("azimuths", "elevations"))
    numbers = {one: (lambda: case.rng.choice((1, 2, 4, 8, 16, 32, 64))) for one in arguments}
    numbers |= {"pictures": lambda: case.rng.random() < 0.5} if "pictures" in arguments else {}
    numbers |= {"path": lambda: "x/y", "policy": None, "name": None} if "path" in arguments else {}
    made = getattr(wrappers, name)(env, **draw(case, numbers))
    if "path" in arguments:
        return  # it would write wherever the value says
    observation, _ = made.reset(seed=1)
    check_observation(made, observation)
    made.step(
        some(case, made.action_space.sample())
        if case.rng.random() < 0.7
        else made.action_space.sample()
    )


def vector(case):
    """Several environments side by side."""
    import gymnasium

    from care_sim.envs import CLOSED_LOOP

    count = some(case, 1, 2)
    # Gymnasium makes as many as it is asked for, and NumPy no array of True rows.
    if isinstance(count, Real) and count > 4:
        return
    count = int(count) if isinstance(count, bool) else count
    name = case.rng.choice([*CLOSED_LOOP])
    env = gymnasium.make_vec(
        name, num_envs=count, vectorization_mode="sync", **draw(case, MORE_BUDGET)
    )
    try:
        env.reset(seed=some(case, 0, [1, 2], None))
        env.step(some(case, np.zeros((count, 32, 512), np.float32)))
    finally:
        env.close()


MORE_BUDGET = {"budget": lambda: 0.1, "min_returns": lambda: 2, "floor": lambda: True}


def configuration(case):
    """What a row of a study is made of, and its digest."""
    from care_sim.study.episode_config import EpisodeConfig

    known = _fields_of(EpisodeConfig) | {"scenario": lambda: "dartout", "policy": lambda: "care"}
    given = {"scenario": "dartout", "policy": "care"} | draw(case, known)
    made = EpisodeConfig(**given)
    _ = made.digest(), made.label, made.row()


def detector(case):
    """Detectors by name."""
    from care_sim.perception.detectors import detector_names, make_detector

    name = case.rng.choice([*detector_names(), some(case)])
    known = dict.fromkeys(("min_returns", "file", "grid", "unknown"))
    make_detector(name, some(case, 1.84), **draw(case, known))


def weights(case):
    """Files of weights that are none."""
    from care_sim.policies.learned.weights import load_weights

    path = some(case, "nowhere", ".", "")
    if isinstance(path, int):
        return  # a file descriptor, which is open for reading elsewhere
    load_weights(path)


def tables(case):
    """Tracks and detections from rows."""
    from care_sim.core.types import ImageDetections, Tracks

    kind = case.rng.choice((ImageDetections, Tracks))
    rows = np.ones((3, len(kind.COLUMNS)))
    rows[case.rng.randrange(3), case.rng.randrange(rows.shape[1])] = case.rng.choice(
        (np.nan, np.inf, -1, 1e30, 1e19)
    )
    case.tell(f"{kind.__name__} {told(rows)}")
    kind.from_rows(rows).rows()


ACTIONS = {
    environment: 12,
    street: 2,
    replay: 2,
    policy: 6,
    belief: 6,
    allocation: 8,
    rig: 4,
    grid: 4,
    scenario: 4,
    conditions: 4,
    wrapper: 3,
    vector: 1,
    configuration: 4,
    detector: 2,
    weights: 1,
    tables: 2,
}
"""What is called, and how often."""
