"""Contrasts of two policies over scenes: values by hand, pairing, weights, thirds, and what cannot
be compared.
"""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.evaluation.recall import Tally
from care_sim.evaluation.scene_contrasts import (
    FIRST_SIGHTING,
    OVERALL,
    TTFD,
    averaged,
    contrast_gap,
    ratio_level,
    scene_contrast,
    scene_share,
)


def tallies(*scenes):
    """Scenes from (events, sighted), ten object frames an event, two frames found for each event
    sighted.
    """
    return {
        f"scene {n}": Tally(events, sighted, 6 * (events - sighted), 10 * events, 2 * sighted)
        for n, (events, sighted) in enumerate(scenes)
    }


def test_levels_by_event_and_by_scene():
    """4 of 10, 1 of 2 and 0 of 8: 5 of 20 events, or 30% of an average scene; one without events is
    in neither.
    """
    found = ratio_level(FIRST_SIGHTING, tallies((10, 4), (2, 1), (8, 0), (0, 0)))
    assert found.by_event == pytest.approx(100 * 5 / 20)
    assert found.by_scene == pytest.approx(30.0)
    assert ratio_level(TTFD, tallies((10, 4), (2, 1))).by_event == pytest.approx(6 * 7 / 12)
    assert ratio_level(OVERALL, tallies((10, 4), (2, 1))).by_event == pytest.approx(100 * 10 / 120)


def test_a_contrast_weighs_events_alike_and_beside_it_scenes():
    ours, theirs = tallies((10, 4), (2, 1), (0, 0)), tallies((10, 2), (2, 1), (0, 0))
    found = scene_contrast(FIRST_SIGHTING, ours, theirs)
    assert found.by_event.mean == pytest.approx(100 * 2 / 12)
    assert found.by_scene.mean == pytest.approx(10.0)
    assert (found.scenes, found.weight) == (2, 12)
    assert (found.by_event.low, found.by_event.high) == pytest.approx((0.0, 20.0))
    assert scene_contrast(TTFD, ours, theirs).by_event.mean == pytest.approx(-12 / 12)
    assert scene_contrast(OVERALL, ours, theirs).weight == 120


@pytest.mark.parametrize(("scenes", "excludes"), [(4, False), (5, True)])
def test_four_scenes_carry_no_claim(scenes, excludes):
    found = scene_contrast(
        FIRST_SIGHTING, tallies(*[(10, 5)] * scenes), tallies(*[(10, 4)] * scenes)
    )
    assert found.excludes_zero == excludes


def test_no_contrast_of_nothing():
    assert ratio_level(FIRST_SIGHTING, tallies((0, 0))).by_event is None
    assert scene_contrast(FIRST_SIGHTING, {}, tallies((1, 1))) is None
    assert scene_contrast(FIRST_SIGHTING, tallies((0, 0)), tallies((0, 0))) is None


def test_floor_seeds_are_averaged_scene_by_scene():
    seeds = [
        {"a": Tally(4, sighted, 6, 10, found), "b": Tally()}
        for sighted, found in [(1, 4), (2, 5), (3, 9)]
    ]
    assert averaged(seeds) == {"a": Tally(4, 2, 6, 10, 6), "b": Tally()}
    assert averaged([seeds[0], {"b": Tally()}]) == {"b": Tally()}
    assert averaged([]) == {}


def test_tallies_of_other_films_are_refused():
    other = tallies((9, 4))
    with pytest.raises(
        InvalidInput, match=r"scene 0: .* one film, got 9 events in 90 .* and 10 events in 100"
    ):
        scene_contrast(FIRST_SIGHTING, tallies((10, 4)), other)
    with pytest.raises(InvalidInput, match=r"scene 0: .* one film"):
        averaged([tallies((10, 4)), other])


def test_the_gap_between_thirds_is_the_difference_of_their_contrasts():
    ours = tallies((10, 5), (10, 7), (30, 10), (10, 4), (10, 3))
    theirs = tallies((10, 4), (10, 4), (30, 9), (10, 4), (10, 3))
    dense, sparse = ["scene 0", "scene 1", "scene 2"], ["scene 3", "scene 4", "scene 9"]
    gap = contrast_gap(FIRST_SIGHTING, ours, theirs, dense, sparse)
    assert gap.mean == pytest.approx(100 * 5 / 50)
    assert 0 < gap.low < gap.mean < gap.high
    back = contrast_gap(FIRST_SIGHTING, ours, theirs, sparse, dense)
    assert back.mean == pytest.approx(-gap.mean)
    assert contrast_gap(FIRST_SIGHTING, ours, theirs, dense, ["scene 3"]) is None
    with pytest.raises(InvalidInput, match="must share none, got scene 2 in both"):
        contrast_gap(FIRST_SIGHTING, ours, theirs, dense, ["scene 2", "scene 3"])


def test_a_share_is_of_all_scenes_also_of_those_in_which_the_whole_found_nothing():
    """3 of 5, 1 of 1 and 2 beside nothing; the last scene has no event."""
    ours = tallies((10, 3), (2, 1), (8, 2), (0, 0))
    whole = tallies((10, 5), (2, 1), (8, 0), (0, 0))
    found = scene_share(FIRST_SIGHTING, ours, whole)
    assert found.interval.mean == pytest.approx(100 * 6 / 6)
    assert scene_share(OVERALL, ours, whole).interval == pytest.approx(found.interval)


def test_a_share_rests_on_the_scenes_in_which_the_whole_found_anything():
    found = scene_share(
        FIRST_SIGHTING, tallies((9, 1), (9, 1), (9, 0)), tallies((9, 4), (9, 0), (9, 0))
    )
    assert (found.scenes, found.interval.mean) == (1, 50.0)


def test_a_share_of_nothing_is_none():
    nothing = tallies((10, 0), (0, 0))
    assert scene_share(FIRST_SIGHTING, tallies((10, 3), (0, 0)), nothing) is None
    assert scene_share(FIRST_SIGHTING, nothing, {}) is None
    assert scene_share(FIRST_SIGHTING, {}, nothing) is None


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=12))
def test_a_share_is_the_quotient_of_the_levels(found):
    ours, whole = (tallies(*[(9, pair[n]) for pair in found]) for n in (0, 1))
    share = scene_share(FIRST_SIGHTING, ours, whole)
    a, b = (ratio_level(FIRST_SIGHTING, each).by_event for each in (ours, whole))
    assert (share is None) == (b == 0)
    if share:
        assert share.scenes == sum(tally.sighted > 0 for tally in whole.values())
        assert share.interval.mean == pytest.approx(100 * a / b)
        assert share.interval.low <= share.interval.mean + 1e-9
        assert share.interval.mean <= share.interval.high + 1e-9
