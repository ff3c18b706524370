"""Refused arguments: every wrong number, name and array from outside is refused in one line, where
it enters."""

from dataclasses import dataclass, fields
from decimal import Decimal
from fractions import Fraction

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.checks import allowed, bounded, check_fields, check_path, one_of
from care_sim.base.errors import InvalidInput, one_line, shown
from care_sim.commands.options.shared import seeds_of
from care_sim.core.allocation import allocate
from care_sim.core.belief import Belief
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.forgetting import ForgettingRules
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.envs.open_loop import FilmEnv
from care_sim.envs.scenarios import DenseEnv
from care_sim.envs.scenes import ReplayEnv, StreetEnv
from care_sim.scenarios import SCENARIOS
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.rows.parameters import parameters
from care_sim.wrappers import GridObservation, SectorReserve, SectorScores

NO_NUMBERS = (float("nan"), float("inf"), 10**5000, -1e300, 1e300, Decimal(1), True, "1", None, [1])


def named(value):
    """The name of a case, the same in every process: no address of an object in it."""
    return type(value).__name__ if " at 0x" in repr(value) else repr(value)[:40]


@pytest.fixture(scope="module")
def dense():
    with gymnasium.make("CARE-Dense-v0", disable_env_checker=True) as env:
        env.reset(seed=1)
        yield env


@pytest.fixture
def observation(dense):
    """One with tracks and detections."""
    policy = care_sim.make_policy("care", dense)
    seen, _ = dense.reset(seed=0)
    for _ in range(5):
        seen, *_ = dense.step(policy(seen))
    return {key: array.copy() for key, array in seen.items()}


def refused(named, make, /, *arguments, **options):
    """The one line with which a call is refused, that names the thing."""
    with pytest.raises(InvalidInput) as refusal:
        make(*arguments, **options)
    line = str(refusal.value)
    assert named in line
    assert line.isprintable()
    assert len(line) < 1000
    return line


BOUNDED = [
    (kind, field.name)
    for kind in (
        ClosedLoopConditions,
        ForgettingRules,
        AngularGrid,
        PinholeCamera,
        Rig,
        *SCENARIOS.values(),
    )
    for field in fields(kind)
    # Numbers of r157 that are None by default depend on each other: they have tests of their own.
    if "bounds" in field.metadata and field.default is not None
]


STATED = {"lidar_stated_range_m": 40.0}
ALONG = dict.fromkeys(("lidar_stated_reflectance", "visibility_m", "rain_mm_h"), STATED)
"""Settings without which a number has no meaning."""


@pytest.mark.parametrize(("kind", "name"), BOUNDED, ids=lambda it: getattr(it, "__name__", it))
def test_every_bounded_number_keeps_its_bounds(kind, name):
    (field,) = (field for field in fields(kind) if field.name == name)
    least, most = field.metadata["bounds"]
    paired = isinstance(field.default, tuple)

    def value(number):
        return (number, number) if paired else number

    for number in NO_NUMBERS:
        refused(name, kind, **{name: value(number)})
    for end, beyond in ((least, least - 1), (most, most + 1)):
        refused(name, kind, **{name: value(beyond)})
        if name not in ("top", "bottom"):  # which bound each other
            made = getattr(kind(**{name: value(end)}, **ALONG.get(name, {})), name)
            assert made == value(end)
            assert type(made[0] if paired else made) is (float if paired else type(field.default))


def test_every_number_of_conditions_and_scenarios_has_bounds():
    for kind in (ClosedLoopConditions, *SCENARIOS.values()):
        for field in fields(kind):
            is_number = field.type == float | None or (
                isinstance(field.default, int | float) and not isinstance(field.default, bool)
            )
            is_range = isinstance(field.default, tuple) and bool(field.default)
            assert ("bounds" in field.metadata) == (is_number or is_range), field.name


@pytest.mark.parametrize(
    "rate", [Fraction(1, 3), np.float32(0.25), np.float64(0.5), 1, np.int64(0)]
)
def test_a_number_of_any_type_becomes_pythons_own(rate):
    config = EpisodeConfig("dense", "care", 0.1, false_negative_rate=rate, min_returns=np.int64(4))
    assert type(config.false_negative_rate) is float
    assert type(config.min_returns) is int
    assert config.false_negative_rate == float(rate)
    assert config.digest()


def test_a_dataclass_is_settled_by_kind():
    @dataclass(frozen=True)
    class Thing:
        flag: bool = False
        name: str = "a"
        count: int = bounded(1, 0, 5)
        share: float = 0.5
        span: tuple[float, float] = bounded((1.0, 2.0), 0, 3)
        several: tuple[float, ...] = (0.3, 0.1)
        kind: str = one_of("a", ("a", "b"))
        drawn_kind: str | None = one_of(None, ("a", "b"))
        drawn: float | None = bounded(None, 0, 3)

        def __post_init__(self):
            check_fields(self, " of it")

    assert Thing(span=[1, 2], share=1) == Thing(span=(1.0, 2.0), share=1.0)
    assert Thing(several=(0.1,)).several == (0.1,)
    assert (Thing().drawn, Thing().drawn_kind) == (None, None)
    assert (Thing(drawn=2).drawn, Thing(drawn_kind="b").drawn_kind) == (2.0, "b")
    assert type(Thing(drawn=2).drawn) is float
    told = [allowed(field) for field in fields(Thing)]
    assert told == ["", "", "0 to 5", "", "0 to 3", "", "of a, b", "of a, b", "0 to 3"]
    for name, value in (
        ("flag", 1),
        ("name", 2),
        ("count", 6),
        ("share", "x"),
        ("span", (2, 1)),
        ("span", (0, 1, 2)),
        ("kind", "c"),
        ("kind", None),
        ("drawn_kind", "c"),
        ("drawn_kind", 5),
        ("drawn", 4),
        ("drawn", "x"),
    ):
        refused(f"{name} of it", Thing, **{name: value})


def test_a_long_value_is_quoted_by_its_ends():
    assert len(shown("x" * 10**6)) <= 120
    assert shown(10**5000) == "a value of type int"
    assert one_line("a \x07\n b") == r"a \x07 b"


@pytest.mark.parametrize(
    "path", ["", "\0", "a" * 300, "a/" * 4000, 5, None, "\ud800", object()], ids=named
)
def test_what_no_file_can_be_called_is_no_path(path):
    refused("file must be a path", check_path, "file", path)


@pytest.mark.parametrize(
    "seed", [-1, 2**63, 10**30, 1.0, True, "1", [1], np.array([1, 2]), float("nan")], ids=named
)
def test_a_seed_that_no_column_holds_begins_no_episode(seed, dense):
    refused("seed must be a whole number", dense.unwrapped.reset, seed=seed)


@pytest.mark.parametrize(
    ("kind", "options", "named"),
    [
        (DenseEnv, {"render_mode": ["rgb_array"]}, "render_mode must be None or 'rgb_array'"),
        (DenseEnv, {"engine": ["fast"]}, "engine must be a name"),
        (DenseEnv, {"occluder": {}}, "occluder"),
        (DenseEnv, {"keyframe_s": 1e9}, "keyframe_s must lie in [0.05, 1]"),
        (DenseEnv, {"duration_s": 1e300}, "duration_s of dense must lie in [0.05, 60]"),
        (DenseEnv, {"reward_weights": 5}, "reward_weights must map terms to numbers"),
        (DenseEnv, {"reward_weights": {"gain": 10**400}}, "reward weight gain"),
        (DenseEnv, {"reward_weights": {5: 1}}, "reward term"),
        (DenseEnv, {"budget": np.array([0.1, 0.2])}, "budget must lie in (0, 1]"),
        (DenseEnv, {"lidar_dead_rows": [[1]]}, "lidar_dead_rows"),
        (StreetEnv, {"detector": ["returns"]}, "detector"),
        (StreetEnv, {"detector_parameters": 5}, "detector_parameters"),
        (FilmEnv, {"film": 5}, "film"),
        (ReplayEnv, {"source": "argoverse2:" + "a" * 300}, "source"),
        (ReplayEnv, {"source": "argoverse2:/tmp", "scene": ["a"]}, "scene must be a name"),
        (ReplayEnv, {"source": "nuscenes:/tmp", "camera_detections": ""}, "camera_detections"),
    ],
)  # fmt: skip
def test_an_argument_of_another_kind_makes_no_environment(kind, options, named):
    refused(named, kind, **options)


@pytest.mark.parametrize(
    "action",
    [
        [[1.0] * 512] * 31 + [[1.0]],
        np.zeros((32, 512), complex),
        np.full((32, 512), 1e300),
        None,
    ],
    ids=["ragged", "complex", "huge", "none"],
)  # fmt: skip
def test_an_action_of_other_things_than_numbers_is_refused(action, dense):
    dense.reset(seed=1)
    refused("action must", dense.step, action)


@pytest.mark.parametrize("number", [[32], 10**30, 2.0, True], ids=named)
@pytest.mark.parametrize(
    ("wrapper", "name"),
    [
        (SectorReserve, "azimuths"),
        (SectorScores, "elevations"),
        (GridObservation, "columns"),
        (GridObservation, "rows"),
    ],
)
def test_a_wrapper_takes_whole_numbers(wrapper, name, number, dense):
    refused(f"{name} must", wrapper, dense, **{name: number})


@pytest.mark.parametrize(
    "demand",
    [
        Demand(layers=1),
        Demand(exploitation=None),
        Demand([1, 2]),
        Demand([[0.5]]),
        Demand([[1, [2, 3]]]),
        Demand(layers=[[1, 2]]),
        Demand([[10**30]]),
        Demand({1: 2}),
    ],
    ids=named,
)  # fmt: skip
def test_a_demand_of_another_form_is_allocated_nothing(demand):
    refused("must", allocate, demand, 10, 0.3)


DAMAGES = {
    "a key is missing": lambda seen: seen.pop("budget"),
    "batched": lambda seen: seen.update({key: array[None] for key, array in seen.items()}),
    "of text": lambda seen: seen.update(ego=np.array(["a", "b", "c"])),
    "ragged": lambda seen: seen.update(ego=[1, [2], 3]),
    "NaN": lambda seen: seen["tracks"].__setitem__((0, 3), np.nan),
    "infinite": lambda seen: seen["ego"].__setitem__(0, np.inf),
    "a budget of NaN": lambda seen: seen.update(budget=np.array([np.nan], np.float32)),
    "a budget above 1": lambda seen: seen.update(budget=np.array([1.5], np.float32)),
    "a range below 0": lambda seen: seen["ranges"].__setitem__((0, 0), -1),
    "a class too high": lambda seen: seen["detections"].__setitem__((0, 0), 5),
    "half a class": lambda seen: seen["detections"].__setitem__((0, 0), 0.5),
    "a track's class below 0": lambda seen: seen["tracks"].__setitem__((0, 1), -1),
    "padding that begins with -2": lambda seen: seen["detections"].__setitem__((-1, 0), -2),
    "a camera too high": lambda seen: seen["detections"].__setitem__((0, 6), 1),
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_what_is_no_observation_is_not_acted_on(damage, observation, dense):
    assert min(observation["detections"][0, 0], observation["tracks"][0, 0]) >= 0
    policy = care_sim.make_policy("care", dense)
    policy(observation)
    damage(observation)
    refused("observation", policy, observation)


def test_an_observation_of_other_numbers_is_read_alike(observation):
    plain = {key: array.tolist() for key, array in observation.items()}
    before, after = (
        Belief.from_observation(seen).to_observation() for seen in (observation, plain)
    )
    assert all(np.array_equal(before[key], after[key]) for key in before)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        (["care"], {}),
        ("care", {"name": "x"}),
        ("care", {"self": 1}),
        ("care-sbf", {"k_safe": "x"}),
        ("ppo", {"path": "\0"}),
    ],
)  # fmt: skip
def test_a_policy_is_made_of_what_it_takes(name, options, dense):
    refused("", lambda: care_sim.make_policy(name, dense, **options))


@pytest.mark.parametrize(
    "value",
    [
        {"a": 1},
        float("nan"),
        2**63,
        "\ud800",
        (1, (2, (3, (4,)))),
    ],
    ids=range(5),
)  # fmt: skip
def test_a_parameter_that_no_file_holds_is_refused(value):
    refused(
        "k_safe must", EpisodeConfig, "dense", "care-sbf", policy_parameters=(("k_safe", value),)
    )


@pytest.mark.parametrize("pairs", [5, "ab", [1], (("a",),)])
def test_parameters_are_pairs(pairs):
    refused(
        "policy_parameters must be pairs", EpisodeConfig, "dense", "care", policy_parameters=pairs
    )


@pytest.mark.parametrize(
    "field", ["scenario", "policy", "budget", "seed", "floor_seed", "azimuth_margin", "engine"]
)
@pytest.mark.parametrize("value", [[1], 10**30, None], ids=named)
def test_an_episode_is_made_of_names_and_numbers(field, value):
    refused("", EpisodeConfig, **{"scenario": "dense", "policy": "care", field: value})


@pytest.mark.parametrize(
    "text",
    [
        "{[1]}", "[" * 3000, "9" * 5000, "\0", "1if 1else 2",
    ],
    ids=shown,
)  # fmt: skip
def test_what_is_no_literal_is_text(text, recwarn):
    assert parameters([f"a={text}"]) == (("a", text),)
    assert not recwarn.list


@pytest.mark.parametrize("number", [0, -1, 10**9, 9999999999999999999999])
def test_a_number_of_seeds_fits_into_memory(number):
    refused("seeds must be one number, a count from 1 to 1,000", seeds_of, [number])
