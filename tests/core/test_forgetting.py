from itertools import pairwise

import numpy as np
import pytest

from care_sim.core.forgetting import Forgetting, ForgettingRules, released_cells
from care_sim.core.rig import Rig
from care_sim.core.types import Ego

WIDTH = 2 * np.pi / 512
STANDING = Ego()


def forgetting(**rules):
    return Forgetting(ForgettingRules(**rules), Rig())


def advanced(memory, tracks, ego=STANDING):
    """Margins and low criticality at the next keyframe."""
    memory.advance(tracks, ego)
    return memory.margins(tracks)


def settled(tracks, ego=STANDING, keyframes=6, **rules):
    """Margins and low criticality after some keyframes of the same scene."""
    memory = forgetting(**rules)
    for _ in range(keyframes):
        margins, low = advanced(memory, tracks, ego)
    return margins.tolist(), low.tolist()


@pytest.mark.smoke
@pytest.mark.parametrize(("speed", "guard"), [(0.0, 4.0), (10.0, 44.0), (8.0, 36.0), (-8.0, 36.0)])
def test_guard_distance_of_the_paper(speed, guard):
    assert ForgettingRules().guard_distance(speed) == guard


@pytest.mark.smoke
def test_static_tracks_are_forgotten_only_outside_the_guard(tracks_at):
    tracks = tracks_at(
        ("car", 3.99, 0, 0, 0), ("car", 4.0, 0, 0, 0), ("car", 4.01, 0, 0, 0), ("car", 0, 40, 0, 0)
    )
    assert settled(tracks) == ([2, 2, 0, 0], [False, False, True, True])


@pytest.mark.parametrize(
    ("speed", "static"), [(0.0, True), (0.49, True), (0.5, False), (1.3, False)]
)
def test_a_walking_person_is_not_static(tracks_at, speed, static):
    _, low = settled(tracks_at(("pedestrian", 30, 0, 0, speed)))
    assert low == [static]


def test_receding_is_judged_relative_to_the_ego(tracks_at):
    """A car that drives ahead at 9 m/s recedes from an ego at 7 m/s and not from one at 9."""
    tracks = tracks_at(("car", 60, 0, 9, 0))
    assert settled(tracks, Ego(7.0))[1] == [True]
    assert settled(tracks, Ego(8.0))[1] == [False]
    assert settled(tracks, Ego(9.0))[1] == [False]


def test_receding_is_radial_in_every_direction(tracks_at):
    away, towards, across = ("car", 0, 30, 0, 5), ("car", 0, -30, 0, 5), ("car", 30, 0, 0, 5)
    behind = ("car", -30, 0, -2, 0)
    assert settled(tracks_at(away, towards, across, behind))[1] == [True, False, False, True]


def test_a_moving_ego_leaves_what_is_behind_it(tracks_at):
    """Range rate of a follower at the ego's own speed is zero; of one that stops it is the ego's
    speed.
    """
    tracks = tracks_at(("car", -45, 0, 8, 0), ("car", -45, 0, 1, 0))
    assert settled(tracks, Ego(8.0))[1] == [False, True]


def test_the_margin_decays_by_a_column_a_keyframe_down_to_none(tracks_at):
    memory, tracks = forgetting(), tracks_at(("car", 30, 0, 0, 0))
    margins = [int(advanced(memory, tracks)[0][0]) for _ in range(5)]
    assert margins[0] >= 1
    assert all(0 <= before - after <= 1 for before, after in pairwise(margins))
    assert margins[-1] == 0


def test_one_unsafe_keyframe_starts_the_streak_anew(tracks_at):
    memory = forgetting()
    still, moving = tracks_at(("car", 30, 0, 0, 0)), tracks_at(("car", 30, 0, 0, 5))
    for _ in range(5):
        memory.advance(still, Ego())
    assert advanced(memory, moving)[0].tolist() == [2]
    assert advanced(memory, still)[0].tolist() == [1]
    assert advanced(memory, still)[0].tolist() == [0]


def test_streaks_belong_to_ids_and_end_with_the_track(tracks_at):
    memory = forgetting()
    first, both = (
        tracks_at(("car", 30, 0, 0, 0), first_id=7),
        tracks_at(("car", 30, 5, 0, 5), ("car", 30, 0, 0, 0)),
    )
    for _ in range(5):
        memory.advance(first, Ego())
    assert advanced(memory, first)[0].tolist() == [0]
    memory.advance(both, Ego())
    assert advanced(memory, first)[0][0] >= 1


@pytest.mark.smoke
@pytest.mark.parametrize(("distance", "columns"), [(10, 2), (20, 2), (30, 2), (33, 1), (50, 1)])
def test_localization_noise_keeps_the_margin_of_equation_4(tracks_at, distance, columns):
    """0.4 m at range r, in columns of 2 pi / 512 rounded up, never more than the full margin."""
    assert min(int(np.ceil(0.4 / distance / WIDTH)), 2) == columns
    assert settled(tracks_at(("car", distance, 0, 0, 0)), position_sigma_m=0.4)[0] == [columns]


def test_a_track_needs_two_frames_before_it_can_be_forgotten(tracks_at):
    margins, low = advanced(forgetting(), tracks_at(("pedestrian", 45, 0, 0, 0), hits=1), Ego(8.0))
    assert (margins.tolist(), low.tolist()) == ([2], [False])


@pytest.mark.parametrize(
    ("hulls", "demanded", "released"),
    [
        ([], [], 0),
        ([[1, 2, 3], [7, 8]], [[1, 2, 3], [7, 8]], 0),
        ([[1, 2, 3], [7, 8]], [[7, 8], [2]], 2),
        # Cells of another hull are not released, and nothing is released twice.
        ([[1, 2, 3], [3, 4]], [[2], [3, 4]], 1),
        ([[1, 2], [2, 3]], [], 3),
        # Sets may ask for more than the hulls.
        ([[1, 2]], [[1, 2, 9]], 0),
    ],
)
def test_released_is_what_no_set_asks_for(hulls, demanded, released):
    cells = [np.array(hull) for hull in hulls]
    assert released_cells(cells, [np.array(own) for own in demanded], 10) == released
