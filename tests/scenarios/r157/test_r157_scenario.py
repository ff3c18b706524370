import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.scenarios import make_scenario
from care_sim.scenarios.r157 import KINDS, SIDES, cases, verdicts


def build(seed=0, **parameters):
    return make_scenario("r157", **parameters).build(np.random.default_rng(seed))


def driven_on(world, seconds):
    """The least clearance, and whether the ego, which never brakes, touched anything."""
    passage = world.advance(0.0, seconds)
    return passage.clearance_m, passage.impact_speed_mps is not None


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_world_is_the_case(kind, side):
    """At the begin of the lane change the bumpers are 25 m apart; 1.5 s later the other has moved
    1.5 m across, and the ego, 10 m/s faster, is 15 m nearer.
    """
    world = build(
        ego_kph=57.6, relative_kph=36.0, gap_m=25.0, lateral_mps=1.0, kind=kind, side=side,
        lead_s=(1.0, 1.0),
    )  # fmt: skip
    other, turn = world.first_sighting, 1 if side == "left" else -1
    half_lengths = (world.ego_kind.size[0] + other.kind.size[0]) / 2
    assert (other.kind.name, world.ego_motion.speed) == (kind, pytest.approx(16.0))
    for seconds, gap, y in ((0.0, 35.0, 3.5), (1.0, 25.0, 3.5), (2.5, 10.0, 2.0), (6.0, -25.0, 0)):
        if seconds > world.time:
            world.advance(0.0, seconds - world.time)
        x, other_y, heading = other.pose_at(world.time)
        assert x - world.ego.pose[0] - half_lengths == pytest.approx(gap, abs=1e-6)
        assert (other_y, heading) == (pytest.approx(turn * y), 0.0)
    world.close()


@pytest.mark.parametrize("side", SIDES)
def test_an_ego_that_never_brakes_is_touched_unless_the_case_is_harmless(side):
    for gap_m in (5.0, 15.0, 25.0, 40.0):
        numbers = {"ego_kph": 60.0, "relative_kph": 40.0, "gap_m": gap_m, "lateral_mps": 0.5}
        axes = {name: [value] for name, value in numbers.items()}
        (word,) = verdicts(cases(**axes, kind="car", side=side))
        world = build(**numbers, kind="car", side=side)
        _, touched = driven_on(world, 10.0)
        world.close()
        assert touched == (word != "harmless")
        assert (word == "harmless") == (gap_m <= 25)


def test_a_world_tells_what_was_drawn_of_its_case():
    world = build(seed=3)
    case = make_scenario("r157").draw_case(np.random.default_rng(3))
    assert world.drawn == vars(case)
    world.close()
    world = build(seed=3, kind="van", ego_kph=60.0)
    assert set(world.drawn) == {"relative_kph", "gap_m", "lateral_mps", "side"}
    given = {"kind": "van", "ego_kph": 60.0} | dict(world.drawn)
    world.close()
    world = build(seed=3, **given)
    assert world.drawn == {}
    world.close()


def test_what_is_not_given_is_drawn_among_the_preventable_cases():
    drawn = [make_scenario("r157").draw_case(np.random.default_rng(seed)) for seed in range(200)]
    assert {*verdicts(drawn)} == {"preventable"}
    assert {case.kind for case in drawn} == {*KINDS}
    assert {case.side for case in drawn} == {*SIDES}
    assert len({*drawn}) > 150


def test_what_is_given_stays_and_may_be_unpreventable():
    given = {"relative_kph": 50.0, "gap_m": 20.0, "lateral_mps": 1.0, "kind": "car"}
    case = make_scenario("r157", **given).draw_case(np.random.default_rng(0))
    assert {name: getattr(case, name) for name in given} == given
    assert (case.ego_kph, verdicts([case])) == (60.0, ["unpreventable"])


@pytest.mark.parametrize(
    ("parameters", "line"),
    [
        ({"ego_kph": 5.0}, r"ego_kph of r157 must lie in \[10.1, 130\], got 5.0"),
        ({"gap_m": "near"}, "gap_m of r157 must lie in"),
        ({"kind": "tram"}, "unknown kind of r157 'tram'; known: bus, car, motorcycle, truck, van"),
        ({"side": "above"}, "unknown side of r157 'above'; known: left, right"),
        (
            {"ego_kph": 20.0, "relative_kph": 15.0},
            "no cut-in of r157 has these speeds and this gap: the other must drive at least",
        ),
        ({"relative_kph": 10.0, "gap_m": 60.0}, "be reached in 6 s"),
    ],
)
def test_impossible_cases_are_refused_in_one_line(parameters, line):
    with pytest.raises(InvalidInput, match=line):
        make_scenario("r157", **parameters)
