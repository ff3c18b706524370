"""The policies of the paper on beliefs with known answers."""

import inspect
from dataclasses import asdict

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.belief import Belief
from care_sim.core.forgetting import ForgettingRules
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import camera_layers
from care_sim.core.types import Ego
from care_sim.policies.paper.blind import horizon_rows
from care_sim.policies.paper.reserves import Care, CareSbf
from care_sim.policies.paper.tracks import uniform_pattern

GRID = AngularGrid()


def layers_of(demand):
    return [[cells.tolist() for cells in layer] for layer in demand.layers]


@pytest.mark.parametrize("count", [0, 1, 5, 31, 246, 491, 8192, 16000, 16384])
def test_the_uniform_pattern_has_exactly_its_size_and_is_even(count):
    cells = uniform_pattern(GRID, count)
    rows = np.bincount(cells // GRID.columns, minlength=GRID.rows)
    assert len(np.unique(cells)) == len(cells) == count
    assert ((cells >= 0) & (cells < GRID.size)).all()
    assert rows.max() - rows.min() <= 1
    for row in np.flatnonzero(rows > 1):
        columns = np.sort(cells[cells // GRID.columns == row] % GRID.columns)
        gaps = np.diff(columns, append=columns[0] + GRID.columns)
        assert gaps.max() - gaps.min() <= 1


def test_history_uniform_spends_exactly_the_reserve_the_same_at_every_keyframe(
    environment, encounter
):
    policy = care_sim.make_policy("history-uniform", environment)
    beliefs = [Belief.from_observation(observation) for observation in encounter]
    patterns = [layers_of(policy.demand(belief)) for belief in beliefs]
    assert len(patterns[0][0][0]) == 819 - round(0.7 * 819)
    assert all(pattern == patterns[0] for pattern in patterns)
    hulls = policy.rig.hulls(beliefs[0].tracks.boxes)
    assert [s.tolist() for s in policy.demand(beliefs[0]).exploitation] == [
        hull.tolist() for hull in hulls
    ]


def test_beam_reduction_keeps_the_rows_nearest_the_horizon():
    """Rows 8, 9, 7, 10 stand at 0.00, -1.33, 1.34 and -2.67 degrees."""
    layers = horizon_rows(GRID, 3 * 512 + 102)
    assert [np.unique(cells // 512).tolist() for cells in layers] == [[8], [9], [7], [10]]
    assert [len(cells) for cells in layers] == [512, 512, 512, 102]
    gaps = np.diff(layers[3], append=layers[3][0] + 512)
    assert set(gaps.tolist()) == {5, 6}


def test_care_priority_adds_the_explained_wedges_as_a_second_layer(environment, encounter):
    priority, care = (care_sim.make_policy(name, environment) for name in ("care-priority", "care"))
    for observation in encounter:
        belief = Belief.from_observation(observation)
        _, explained = camera_layers(belief, priority.rig)
        expected = [*layers_of(care.demand(belief)), [wedge.tolist() for wedge in explained]]
        assert layers_of(priority.demand(belief)) == expected
    assert any(not np.array_equal(priority(o), care(o)) for o in encounter)


def test_all_camera_has_one_layer_or_those_of_care_priority(environment, encounter):
    named = [("all-camera", {}), ("all-camera", {"unexplained_first": True}), ("care-priority", {})]
    one, two, priority = (care_sim.make_policy(n, environment, **own) for n, own in named)
    for observation in encounter:
        belief = Belief.from_observation(observation)
        assert len(one.demand(belief).layers) <= 1
        assert layers_of(two.demand(belief)) == layers_of(priority.demand(belief))
    assert any(not np.array_equal(one(o), two(o)) for o in encounter)


def scan_of(*points):
    """A last scan with returns (x, y, z) in the sensor frame, moved to the middle of their cells;
    and the cells.
    """
    picture = np.zeros(GRID.size, np.float32)
    cells = GRID.cells_of(points)
    picture[cells] = np.linalg.norm(points, axis=1)
    return picture.reshape(GRID.shape), cells.tolist()


@pytest.fixture
def uncertainty(environment):
    return care_sim.make_policy("uncertainty", environment)


def test_unexplained_returns_are_served_in_shells_the_nearest_first(uncertainty, belief_of):
    ranges, (far, near, beside) = scan_of((20.5, 3, 0), (7.5, -2, 0), (7.4, 2.1, 0))
    assert layers_of(uncertainty.demand(belief_of(ranges=ranges))) == [
        [sorted([near, beside])],
        [[far]],
    ]


def test_cells_that_did_not_fire_or_return_are_no_uncertainty(uncertainty, belief_of):
    ranges = np.zeros(GRID.shape, np.float32)
    ranges[8] = 50.0
    assert layers_of(uncertainty.demand(belief_of(ranges=ranges))) == []


def test_ground_is_no_uncertainty(uncertainty, belief_of):
    """The sensor stands 1.84 m above the road; a return 0.2 m above it is ground, one at 0.5 m is
    not.
    """
    ranges, (_, kerb) = scan_of((4, 0, -1.64), (4, 2, -1.34))
    assert layers_of(uncertainty.demand(belief_of(ranges=ranges))) == [[[kerb]]]


def test_returns_of_a_detected_car_are_explained_and_those_beside_it_are_not(
    uncertainty, belief_of, car
):
    """Its near side stands at 17.7 m, its flank at 0.975 m."""
    ranges, (_, beside) = scan_of((17.7, 0, -1), (17.7, 1.6, -1))
    belief = belief_of([car(0, 20)], ranges=ranges)
    assert layers_of(uncertainty.demand(belief)) == [[[beside]]]


def test_a_track_that_was_not_detected_explains_nothing(uncertainty, belief_of, car):
    ranges, (missed,) = scan_of((17.7, 0, -1))
    assert layers_of(uncertainty.demand(belief_of([car(0, 20, misses=1)], ranges=ranges))) == [
        [[missed]]
    ]


def test_boxes_are_moved_back_to_the_last_scan(uncertainty, belief_of, car):
    """A car crosses at 20 m/s, the ego came 1.1 m nearer: its far side stood at (23.4, -2)."""
    ranges, _ = scan_of((23.3, -2, -1))
    crossing = car(0, 20, vy=20.0)
    assert layers_of(uncertainty.demand(belief_of([crossing], Ego(10.5, 0, -10), ranges))) == []
    assert layers_of(uncertainty.demand(belief_of([crossing], Ego(0), ranges))) != []
    assert layers_of(uncertainty.demand(belief_of([car(0, 20)], Ego(10.5, 0, -10), ranges))) != []


def test_boxes_are_turned_back_to_the_last_scan(uncertainty, belief_of, car):
    """The ego has turned left by 0.1 rad: what is dead ahead was 0.1 rad to the left."""
    ranges, _ = scan_of((17.7 * np.cos(0.1), 17.7 * np.sin(0.1), -1))
    assert layers_of(uncertainty.demand(belief_of([car(0, 20)], Ego(0, 1.0), ranges))) == []
    assert layers_of(uncertainty.demand(belief_of([car(0, 20)], Ego(0, 0.0), ranges))) != []


TURN = np.deg2rad(20.0)


@pytest.fixture
def late(environment, seen):
    """The belief of a box at the middle of the picture, since which the car has turned left."""
    rig = environment.unwrapped.rig
    box = ("pedestrian", 150.0, 80.0, 170.0, 120.0)
    ranges = np.zeros(rig.grid.shape, np.float32)

    def belief(tracks, yaw_change=TURN):
        return Belief(Ego(8.0), rig.budget, seen(box, yaw_change=yaw_change), tracks, ranges)

    return rig, belief


def wedge_of(policy, belief):
    ((wedge,),) = policy.demand(belief).layers
    return wedge.tolist()


def test_a_late_wedge_is_turned_back_unless_it_is_left(late, tracks_at):
    rig, belief = late
    nobody = tracks_at()
    now = wedge_of(Care(rig), belief(nobody, yaw_change=0.0))
    turned = wedge_of(Care(rig), belief(nobody))
    left = wedge_of(Care(rig, yaw_compensation=False), belief(nobody))
    assert left == now
    # The car has turned to the left: what was ahead is now to the right, at lower columns.
    columns = [np.mean(np.array(cells) % rig.grid.columns) for cells in (now, turned)]
    assert columns[0] - columns[1] == pytest.approx(TURN / rig.grid.column_width, abs=1.0)


def test_the_match_with_forecasts_follows_the_same_rule(late, tracks_at):
    """A forecast ahead explains the box as if it were new; one to the right explains the late
    box.
    """
    rig, belief = late
    ahead = tracks_at(("pedestrian", 15.0, 0.0, 0.0, 0.0))
    right = tracks_at(("pedestrian", 15.0 * np.cos(TURN), -15.0 * np.sin(TURN), 0.0, 0.0))
    compensated, plain = Care(rig), Care(rig, yaw_compensation=False)
    unexplained = {
        (name, place): len(policy.demand(belief(tracks)).layers[0])
        for name, policy in (("compensated", compensated), ("plain", plain))
        for place, tracks in (("ahead", ahead), ("right", right))
    }
    assert unexplained == {
        ("compensated", "ahead"): 1,
        ("compensated", "right"): 0,
        ("plain", "ahead"): 0,
        ("plain", "right"): 1,
    }


def made(scenario, policy="care", budget=0.05, **parameters):
    env = gymnasium.make(scenario, budget=1.0 if policy == "full" else budget, **parameters)
    return env, care_sim.make_policy(policy, env)


def test_care_differs_from_all_camera_only_by_what_tracks_explain(encounter, environment):
    """Where everything is explained, CARE is history; where nothing is, it is the all-camera
    reserve.
    """
    care, everything, history = (
        care_sim.make_policy(n, environment) for n in ("care", "all-camera", "history")
    )
    no_tracks = np.zeros_like(encounter[0]["tracks"])
    no_tracks[:, 0] = -1
    for observation in encounter:
        untracked = {**observation, "tracks": no_tracks}
        assert np.array_equal(care(untracked), everything(untracked))
    assert any(np.array_equal(care(o), history(o)) for o in encounter)
    assert any(not np.array_equal(care(o), everything(o)) for o in encounter)


def test_full_asks_for_everything_and_refuses_another_budget(environment):
    env, full = made("CARE-Dartout-v0", "full")
    observation, _ = env.reset(seed=0)
    assert np.all(full(observation) > 0)
    env.close()
    with pytest.raises(InvalidInput, match=r"full needs .*budget=1\.0.*819 of 16384"):
        care_sim.make_policy("full", environment)


def test_history_demands_the_hulls_nearest_first(environment, belief_of, car):
    history = care_sim.make_policy("history", environment)
    rig = environment.unwrapped.rig
    belief = belief_of([car(0, 10), car(1, 20, 5), car(2, 40, -5)])
    hulls = rig.grid.hulls(belief.tracks.boxes)
    assert [s.tolist() for s in history.demand(belief).exploitation] == [
        hull.tolist() for hull in hulls
    ]
    assert not any(len(layer) for layer in history.demand(belief).layers)


def test_forgetting_serves_full_hulls_before_shrunk_ones_and_keeps_the_elevation_pad(
    environment, belief_of, car
):
    sbf = care_sim.make_policy("care-sbf", environment)
    rig = environment.unwrapped.rig
    belief = belief_of([car(0, 10), car(1, 20, 5, vy=3.0), car(2, 30, -5)])
    sbf.reset()
    for _ in range(5):
        sbf.remember(belief)
    demand = sbf.demand(belief)
    near, moving, far = belief.tracks.boxes
    bare_near, bare_far = rig.grid.hulls([near, far], 0)
    (full_moving,) = rig.grid.hulls([moving])
    assert [cells.tolist() for cells in demand.exploitation] == [
        full_moving.tolist(),
        bare_near.tolist(),
        bare_far.tolist(),
    ]


def test_the_parameters_of_forgetting_are_its_rules_with_their_defaults():
    rig, *rules = inspect.signature(CareSbf).parameters.values()
    assert rig.name == "rig"
    assert {rule.name: rule.default for rule in rules} == asdict(ForgettingRules())


def test_parameters_of_forgetting_reach_the_rules(environment, belief_of, car):
    belief = belief_of([car(0, 10)], Ego(8.0))
    guarded, unguarded = (
        care_sim.make_policy("care-sbf", environment, **p) for p in ({}, {"k_safe": 0.0})
    )
    for _ in range(5):
        guarded.remember(belief)
        unguarded.remember(belief)
    kept, dropped = (policy.demand(belief).exploitation for policy in (guarded, unguarded))
    assert len(kept[0]) > len(dropped[0])


@pytest.mark.parametrize(
    ("name", "parameters", "named"),
    [
        (
            "clairvoyant",
            {},
            r"policy 'clairvoyant'; known: after-ancha, after-gofer, after-shoouri, all-camera",
        ),
        ("care", {"boldness": 2}, "boldness"),
        ("care-sbf", {"k_save": 2}, r"'k_save'.*k_safe"),
    ],
)
def test_unknown_policies_and_parameters_are_refused_by_name(name, parameters, named, environment):
    with pytest.raises(InvalidInput, match=named):
        care_sim.make_policy(name, environment, **parameters)


def test_the_reserve_fraction_of_the_environment_is_obeyed():
    env, history = made("CARE-Dense-v0", "history", reserve_fraction=1.0)
    observation, _ = env.reset(seed=0)
    for _ in range(5):
        observation, *_ = env.step(history(observation))
    assert (observation["tracks"][:, 0] >= 0).any()
    assert not history(observation).any()
    env.close()
