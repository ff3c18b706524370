"""The mechanism of a film made by hand, whose answers are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.evaluation.rays import RAY_SHARES
from care_sim.evaluation.sightings import Sightings
from care_sim.policies.paper.reserves import Care
from care_sim.sources.named import source_of
from care_sim.sources.scenes import Scene
from care_sim.study.mechanism_play import (
    BELIEF_MARKS,
    BELIEF_SUMS,
    account_play,
    is_covered,
    play_mechanism,
    share_belief,
)
from care_sim.study.play_config import PlayConfig, mechanism_plays
from tests.helpers.handmade_film import (
    BEHIND,
    BESIDE,
    BUS,
    GRID,
    OBJECTS,
    WALKER,
    handmade_film,
    returns_of,
)

FILM = handmade_film()
SIGHTINGS = Sightings.of("handmade", [shot.annotations for shot in FILM.shots])
STREETS = source_of("streets")
RIG = Rig(cameras=FILM.cameras, keyframe_s=FILM.keyframe_s)
EVENTS = [WALKER, BESIDE, BEHIND, BUS]


def config(policy, **conditions):
    """Without the floor, so that nothing is found by chance."""
    return PlayConfig(STREETS, Scene("handmade", 0), policy, **({"floor": False} | conditions))


def account(policy, **conditions):
    row = account_play(config(policy, **conditions), FILM, SIGHTINGS)
    rays = np.array([row[f"rays_{share}"] for share in RAY_SHARES]).T
    lists = (list(row[name]) for name in ("misses", "ttfds", "tracked"))
    return SimpleNamespace(
        **dict(zip(("reasons", "delays", "tracked"), lists, strict=True)), rays=rays
    )


def wedge_of(number):
    """The wedge of an object's image box at the last keyframe."""
    seen = FILM.shots[-1].seen
    (place,) = np.flatnonzero(seen.objects == number)
    return wedges(seen.detections, RIG)[place]


def test_an_object_is_covered_where_tracks_hold_half_of_its_hull():
    assert is_covered(np.arange(4), np.array([0, 3]))
    assert not is_covered(np.arange(4), np.array([3, 9, 10]))


def test_the_films_events_are_those_it_was_made_for():
    assert SIGHTINGS.frames.objects[SIGHTINGS.events].tolist() == EVENTS


def test_care_fires_its_wedge_at_the_walker_and_misses_what_a_neighbour_explains():
    told = account("care")
    assert told.reasons == ["", "explained", "not in picture", ""]
    assert told.delays == [0, 6, 6, 0]
    assert told.rays[:3].tolist() == [[0, len(returns_of(WALKER)), 0, 0, 0], [0] * 5, [0] * 5]


def test_all_camera_fires_at_what_the_neighbour_explains_too():
    told = account("all-camera")
    assert told.reasons == ["", "", "not in picture", ""]
    assert told.rays[1].tolist() == [0, len(returns_of(BESIDE)), 0, 0, 0]


def test_of_the_explained_box_care_sbf_and_care_priority_fire_it_from_their_second_layer():
    for policy in ("care-sbf", "care-priority"):
        told = account(policy)
        assert told.reasons == ["", "", "not in picture", ""]
        assert told.rays[1].tolist() == [0, 0, len(returns_of(BESIDE)), 0, 0]


def test_history_asks_for_none_of_them():
    told = account("history")
    assert told.reasons == ["not demanded", "not demanded", "not in picture", "not demanded"]
    assert not told.rays.any()


def test_with_a_budget_of_a_few_cells_the_wedge_starves_and_then_goes_to_its_rim():
    """Three wedges take turns; rows come from the top, where the margin is."""
    assert account("care", budget=6 / GRID.size).reasons[0] == "starved"
    assert account("care", budget=12 / GRID.size).reasons[0] == "elsewhere"


def test_a_lost_return_is_no_fault_of_the_policy():
    told = account("all-camera", lidar_dropout=1.0)
    assert told.reasons[:2] == ["too few returns", "too few returns"]


def test_an_object_found_beyond_the_scored_range_is_tracked_when_it_enters():
    """CARE's wedge found the bus at the first keyframe; its hull finds it now."""
    told = account("care")
    assert told.tracked == [0, 0, 0, 1]
    assert told.rays[3].tolist() == [len(returns_of(BUS)), 0, 0, 0, 0]


def test_on_one_belief_policies_differ_by_their_rule_alone():
    others = [config("history"), config("all-camera")]
    shared = share_belief(config("care"), others, FILM, SIGHTINGS)
    seen = [new.appearance for new in shared.entries]
    assert [len(each.wedges) for each in seen] == [1, 1, 0, 1]
    assert [each.falsely_explained for each in seen] == [False, True, False, False]
    assert [new.covered for new in shared.entries] == [False, False, False, True]

    # No track at the first keyframe: everything is unexplained, and history has nothing to fire at.
    assert np.array_equal(shared.fired["care"][0], shared.fired["all-camera"][0])
    assert not len(shared.fired["history"][0])
    # A wedge is seen from the camera, and holds most of a hull. The neighbour explains the box of
    # the second, at which all-camera fires, and a hull of its own holds the bus.
    hulls = RIG.hulls(np.array([OBJECTS[number][1] for number in EVENTS]))
    in_wedge = [
        int(np.isin(hull, wedge_of(number)).sum())
        for number, hull in zip(EVENTS[:2], hulls, strict=False)
    ]
    assert shared.received["history"] == [0, 0, 0, len(hulls[3])]
    assert shared.received["care"] == [in_wedge[0], 0, 0, len(hulls[3])]
    assert shared.received["all-camera"] == [*in_wedge, 0, len(hulls[3])]
    assert shared.reserve.keyframes == 3
    assert shared.reserve.filled == 0
    assert 0 < shared.reserve.untaken_cells < shared.reserve.explained_cells


def test_asking_others_changes_nothing_for_the_driver():
    alone = share_belief(config("care", floor=True), [], FILM, SIGHTINGS)
    asked = share_belief(
        config("care", floor=True), [config("random", floor=True)], FILM, SIGHTINGS
    )
    assert all(map(np.array_equal, alone.fired["care"], asked.fired["care"]))
    assert account("care", floor=True).delays == account("care", floor=True).delays


def test_a_policy_that_states_no_demand_is_told_in_one_line(monkeypatch):
    monkeypatch.setattr(
        Care, "__call__", lambda self, observation: np.zeros(GRID.shape, np.float32)
    )
    with pytest.raises(InvalidInput, match="policy care states no demand"):
        account("care")


def test_a_scene_gives_a_row_for_the_driver_the_policies_and_the_full_scan(monkeypatch):
    monkeypatch.setattr(type(STREETS), "film", lambda source, scene, returns: FILM)
    configs = mechanism_plays(
        STREETS, [Scene("handmade", 0)], ["history"], budget=0.1, driver="care", floor=False
    )
    assert [each.policy for each in configs] == ["care", "history", "full"]
    care, history, full = play_mechanism(configs)
    assert all(row["driver"] == "care" for row in (care, history, full))
    assert (care["differing_keyframes"], history["differing_keyframes"]) == (None, 2)
    assert care["pictured"] == (1, 1, 0, 1)
    assert care["falsely_explained"] == (0, 1, 0, 0)
    assert history["misses"] == ("not demanded", "not demanded", "not in picture", "not demanded")
    assert full["ttfds"] == (0, 0, 0, 0)
    assert full["received"] is None
    assert all(history[name] is None for name in (*BELIEF_SUMS, *BELIEF_MARKS))
    # Going on where a run was stopped gives the same row.
    (again,) = play_mechanism(configs[1:2])
    assert {**again, "wall_s": 0, "peak_rss_mb": 0} == {**history, "wall_s": 0, "peak_rss_mb": 0}


def test_a_driver_without_a_budget_or_with_parameters_is_refused():
    scenes = [Scene("handmade", 0)]
    with pytest.raises(InvalidInput, match="driver must be a policy with a budget, got 'full'"):
        mechanism_plays(STREETS, scenes, ["care"], budget=0.1, driver="full")
    with pytest.raises(InvalidInput, match="driver care-sbf plays without parameters, got k_safe"):
        mechanism_plays(
            STREETS,
            scenes,
            ["history"],
            budget=0.1,
            driver="care-sbf",
            policy_parameters=(("care-sbf.k_safe", 0.0),),
        )
