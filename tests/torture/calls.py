"""Campaign: random calls of the public interface, with values that nobody asked for.

A call must return, or raise what `judge.call` allows. A returned value has to be sound:
observations lie in their space, rewards are finite and at most 0, no more cells fire than may, none
twice.

Doors (making, resetting, stepping, policies, beliefs, allocation, configurations) are given
anything at all. The arithmetic of grid and tables is given arrays of the shape that it asks for,
with any numbers in them.
"""

from contextlib import suppress
from dataclasses import MISSING, fields
from functools import lru_cache, partial
from warnings import catch_warnings, simplefilter

import numpy as np

from tests.torture import hostile, judge
from tests.torture.case import DONE, Fault, words

LIMIT_S = 10.0
MORE = words("reward_weights render_mode keyframe_s budget seed self unknown")
OF_STREETS = words("detector detector_parameters render_mode budget keyframe_s source unknown")
OF_REPLAYS = words(
    "source scene split version camera_detections sweeps sensor reference topics detector budget "
    "unknown"
)
RECORDINGS = words("argoverse2:. nuscenes:. argoverse2: nuscenes:/nowhere sweeps:. :")
ODD_NUMBERS = (np.nan, np.inf, -np.inf, 1e30, -1e30, 1e300, 1e9, 1e-300, 0, -7, 5, 99)


def prepare(_name):
    good_observation()


def play(case):
    action = case.rng.choices([*ACTIONS], [*ACTIONS.values()])[0]
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
    case.tell(", ".join(f"{name}={told(value)}" for name, value in drawn.items()))
    return drawn


def some(case, *fitting):
    """A value: one of the fitting, or a hostile one."""
    rng = case.rng
    value = rng.choice(fitting) if fitting and rng.random() < 0.4 else hostile.objects(rng)
    case.tell(f"value {told(value)}")
    return value


def _fields_of(kind):
    """The fields of a dataclass, with makers of their defaults."""
    return {
        one.name: (lambda one=one: one.default) if one.default is not MISSING else None
        for one in fields(kind)
    }


def _with_odd_number(case, array):
    """A flat place among the first of an array, with another number."""
    flat = array.reshape(-1)
    flat[case.rng.randrange(min(flat.size, 90))] = case.rng.choice(ODD_NUMBERS)
    return array


def environment(case):
    """Make an environment of the closed loop, reset it, take a few steps."""
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
    given = draw(case, known)
    with make(**given) as env:
        _played(case, env, "reward_weights" in given)


def open_loop(case):
    """A generated street, of which few are drawn: they take a moment; or texts that name no
    recording.
    """
    import gymnasium

    from care_sim.core.conditions import Conditions

    if case.rng.random() < 0.5:
        known = dict.fromkeys(OF_REPLAYS) | {"source": lambda: case.rng.choice(RECORDINGS)}
        given = draw(case, known)
        gymnasium.make("CARE-Replay-v0", disable_env_checker=True, **given).close()
        return
    given = draw(case, _fields_of(Conditions) | dict.fromkeys(OF_STREETS))
    with gymnasium.make("CARE-Street-v0", disable_env_checker=True, **given) as env:
        if case.rng.random() < 0.2:
            _played(case, env)


def _played(case, env, is_weighted=False):
    seed = some(case, 0, 1, 2, None)
    observation, _ = env.reset(seed=seed, options=case.rng.choice((None, {}, {"a": 1}, "x", 5)))
    check_observation(env, observation)
    for _ in range(case.rng.randrange(4)):
        observation, reward, terminated, truncated, info = env.step(_action(case))
        check_observation(env, observation)
        if not (is_weighted or (np.isfinite(reward) and reward <= 0)):
            raise Fault("a reward that is not finite and at most 0", repr(reward))
        _check_cells(info["fired"], env.unwrapped.rig.budget, env.unwrapped.rig.grid.size)
        if terminated or truncated:
            break
    env.render()


def _action(case):
    rng = case.rng
    good = np.random.default_rng(rng.randrange(9)).random((32, 512), np.float32)
    kinds = (
        lambda: good,
        lambda: _with_odd_number(case, good),
        lambda: good > 0.9,
        lambda: np.zeros((32, 512)),
        lambda: good.tolist(),
        lambda: good[:, ::-1],
        lambda: good.astype(object),
        lambda: hostile.objects(rng),
    )
    action = rng.choice(kinds)()
    case.tell(f"action {told(action)}")
    return action


def check_observation(env, observation):
    for name, space in getattr(env.observation_space, "spaces", {}).items():
        given = observation[name]
        if space.contains(given):
            continue
        if given.shape != space.shape:
            raise Fault("an observation outside its space", f"{given.shape}", name)
        wrong = np.argwhere(~((given >= space.low) & (given <= space.high)))[:3].tolist()
        values = [float(given[tuple(index)]) for index in wrong]
        column = wrong[0][-1] if wrong else given.dtype
        told = f"{wrong} {values}"
        raise Fault("an observation outside its space", told, f"{name}, column {column}")


def _check_cells(cells, budget, size):
    cells = np.asarray(cells)
    is_within = not len(cells) or 0 <= cells.min() <= cells.max() < size
    if len(cells) > budget or len(np.unique(cells)) < len(cells) or not is_within:
        what = f"{len(cells)} of {budget}: {cells[:5]}"
        raise Fault("cells beyond the budget, twice or outside the grid", what)


def policy(case):
    """Make a policy and ask it."""
    from care_sim.policies import BUILT_IN, make_policy, maker, policy_names
    from care_sim.policies.makers import settable

    name = case.rng.choice([*policy_names(), some(case)])
    case.tell(told(name))
    env = good_env() if case.rng.random() < 0.9 else some(case)
    make = maker(name) if isinstance(name, str) and name in BUILT_IN else None
    known = {one.name: None for one in settable(make)} if make else {}
    given = draw(case, known | dict.fromkeys(("path", "k_safe", "unknown")))
    made = make_policy(name, env, **given)
    made.reset()
    action = made(_observation(case))
    if action.shape != (32, 512) or not np.isfinite(action).all():
        raise Fault("an action that is none", str(action))


def _observation(case):
    """One of the environments', with something wrong in it; or something else."""
    rng = case.rng
    observation = {name: value.copy() for name, value in good_observation().items()}
    name = rng.choice(sorted(observation))
    change, make = rng.choice(CHANGES)
    case.tell(f"observation, {name}: {change}")
    if change == "another":
        return some(case)
    if change == "gone":
        del observation[name]
    else:
        observation[name] = make(case, observation[name])
    return observation


_DTYPES = (np.float64, np.int64, complex, object, str)
CHANGES = (
    ("gone", None),
    ("another", None),
    ("as it is", lambda case, value: value),
    ("anything", lambda case, value: some(case)),
    ("type", lambda case, value: value.astype(case.rng.choice(_DTYPES))),
    *(("number", _with_odd_number),) * 3,
    ("half", lambda case, value: value[: len(value) // 2]),
    ("deeper", lambda case, value: value[..., None]),
    ("list", lambda case, value: value.tolist()),
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
        what = f"{len(chosen)} of {budget}"
        raise Fault("an allocation beyond the budget, or of a cell twice", what)


def geometry(case):
    """The grid and the rig, and what they cover."""
    from care_sim.core.grid import AngularGrid
    from care_sim.core.rig import Rig
    from care_sim.sensors.pictures import FRONT_CAMERA

    rng = case.rng
    boxes = np.tile([10.0, 1.0, -1.0, 4.0, 2.0, 1.5, 0.1], (3, 1))
    boxes = _with_odd_number(case, boxes) if rng.random() < 0.9 else boxes[:0]
    bundles = np.random.default_rng(rng.randrange(99)).normal(size=(2, 5, 3))
    bundles = _with_odd_number(case, bundles)
    if rng.random() < 0.5:
        known = _fields_of(Rig) | {"grid": AngularGrid, "cameras": lambda: (FRONT_CAMERA,)}
        made = Rig(**draw(case, known))
        made.hulls(boxes)
        made.grid.wedges(bundles, made.azimuth_margin, made.elevation_margin)
        _ = made.camera_models
        return
    made = AngularGrid(**draw(case, _fields_of(AngularGrid)))
    if made.size > 2**24:
        return  # honest work
    made.cells_of(bundles[0])
    made.hulls(boxes, rng.choice((0, 2, 99, 10**6)), rng.choice((0, 1, 99)))
    made.wedges(bundles)
    _ = made.directions, made.fan


def scenario(case):
    """A scenario, and a world of it."""
    from care_sim.scenarios import SCENARIOS, make_scenario

    name = case.rng.choice([*SCENARIOS]) if case.rng.random() < 0.95 else some(case)
    case.tell(told(name))
    known = _fields_of(SCENARIOS[name]) if isinstance(name, str) and name in SCENARIOS else {}
    made = make_scenario(name, **draw(case, known | {"unknown": None}))
    made.build(np.random.default_rng(0)).close()


def configuration(case):
    """The configuration of a study's row, and its digest; the conditions alone; or a detector."""
    from care_sim.core.conditions import ClosedLoopConditions
    from care_sim.perception.detectors import detector_names, make_detector
    from care_sim.study.episode_config import EpisodeConfig

    roll = case.rng.random()
    if roll < 0.4:
        ClosedLoopConditions(**draw(case, _fields_of(ClosedLoopConditions), 5))
    elif roll < 0.6:
        name = case.rng.choice([*detector_names(), some(case)])
        known = dict.fromkeys(("min_returns", "file", "grid", "unknown"))
        make_detector(name, some(case, 1.84), **draw(case, known))
    else:
        known = _fields_of(EpisodeConfig) | {
            "scenario": lambda: "dartout",
            "policy": lambda: "care",
        }
        made = EpisodeConfig(**{"scenario": "dartout", "policy": "care"} | draw(case, known))
        _ = made.digest(), made.label, made.row()


def wrapper(case):
    """Wrappers around an environment, or around something else."""
    from care_sim import wrappers

    name, parameters = case.rng.choice([*WRAPPERS.items()])
    case.tell(name)
    env = good_env() if case.rng.random() < 0.9 else some(case)
    known = {one: lambda: case.rng.choice((1, 2, 4, 8, 16, 32, 64)) for one in parameters}
    known |= {one: None for one in ("policy", "name") if one in parameters}
    known |= {"path": lambda: "x/y"} if "path" in parameters else {}
    made = getattr(wrappers, name)(env, **draw(case, known))
    if "path" in parameters:
        return  # it would write wherever the value says
    observation, _ = made.reset(seed=1)
    check_observation(made, observation)
    made.step(some(case, made.action_space.sample()))


WRAPPERS = {
    "GridObservation": ("columns", "rows", "pictures"),
    "SectorReserve": ("azimuths", "elevations"),
    "SectorScores": ("azimuths", "elevations"),
    "RecordRerun": ("path", "policy", "name"),
    "ExportScans": ("path", "policy"),
}


def tables(case):
    """Tracks and detections from rows."""
    from care_sim.core.types import ImageDetections, Tracks

    kind = case.rng.choice((ImageDetections, Tracks))
    rows = _with_odd_number(case, np.ones((3, len(kind.COLUMNS))))
    case.tell(f"{kind.__name__} {told(rows)}")
    kind.from_rows(rows).rows()


ACTIONS = {
    environment: 12,
    open_loop: 4,
    policy: 6,
    belief: 6,
    allocation: 8,
    geometry: 8,
    scenario: 4,
    configuration: 9,
    wrapper: 3,
    tables: 2,
}
"""Kinds of calls, and how often each is made."""
