"""The map of the open loop: who is found, who appears, what was known, what each share paid."""

from dataclasses import replace

import numpy as np
import pytest

from care_sim.core.firing.actions import EXPLOITATION, FLOOR, RESERVE
from care_sim.core.residual import wedge_rays
from care_sim.envs.wrappers.record_rerun import Watching
from care_sim.sources.named import source_of
from care_sim.study.play_config import play_grid
from care_sim.study.scene_play import trace_scene
from care_sim.viewer.palette import EXPLAINED_COLOUR, FOUND_COLOUR, NOT_FOUND_COLOUR, SHARE_COLOURS
from care_sim.viewer.pictures.keyframe import (
    BELOW_SIZE,
    CELLS_TOP,
    PICTURE_WIDTH,
    STREET_TOP,
    draw_keyframe,
)
from care_sim.viewer.pictures.scene_view import (
    DETECTED_COLOUR,
    KERB_COLOUR,
    MAP_HEIGHT,
    MISSED_COLOUR,
    RETURN_COLOUR,
    TRACK_COLOUR,
    scene_view,
)

STEPS_OUT = 5
"""The keyframe at which the person of the drive appears."""
MAP = slice(STREET_TOP, STREET_TOP + MAP_HEIGHT)


class Drawn(Watching):
    """Draws every keyframe twice: as one that was watched, and as one that was not."""

    def __init__(self, env, policy, kept):
        super().__init__(env, policy)
        self._kept = kept

    def begin(self, loop, episode):
        pass

    def keep(self, watched):
        plain, known = (
            np.asarray(draw_keyframe(scene_view(self._inner.loop, [watched.record], given)))
            for given in (None, watched)
        )
        self._kept.append((watched, plain, known))

    def end(self, outcome):
        pass


@pytest.fixture(scope="module")
def play(drive):
    """The keyframes of a policy in the drive, with their pictures."""
    source = source_of(f"argoverse2:{drive}")

    def make(policy, budget, kerbs=()):
        (config,) = play_grid(source, source.scenes(), [policy], [budget])
        kept = []
        film = replace(config.film(), kerbs=kerbs)
        trace_scene(config, film, wrap=lambda env, policy: Drawn(env, policy, kept))
        return kept

    return make


@pytest.fixture(scope="module")
def drawn(play):
    return play("care", 0.05)


def count(part, colour):
    """Pixels of a colour."""
    return int(np.all(part == colour, axis=-1).sum())


def test_newcomers_alone_have_a_colour_which_says_whether_they_are_detected(play):
    full, starved = play("full", 1.0), play("random", 1e-4)
    for picture, other in ((full[0][1], DETECTED_COLOUR), (starved[0][1], MISSED_COLOUR)):
        assert count(picture[MAP], other) > 50
        assert count(picture[MAP], FOUND_COLOUR) == count(picture[MAP], NOT_FOUND_COLOUR) == 0
    assert count(full[0][1][MAP], RETURN_COLOUR) > 500
    # A return is a square of four pixels.
    assert count(starved[0][1][MAP], RETURN_COLOUR) <= 8
    for played, colour in ((full, FOUND_COLOUR), (starved, NOT_FOUND_COLOUR)):
        plain, known = ([count(each[which][MAP], colour) for each in played] for which in (1, 2))
        assert np.flatnonzero(plain).tolist() == [STEPS_OUT]
        # Where it is known what the policy knew, the person also has a name.
        assert known[STEPS_OUT] > plain[STEPS_OUT] + 50


def test_kerbs_are_drawn_where_the_film_has_them(play, drawn):
    """A kerb 5 m left of the car, which drives along it."""
    kerb = np.array([[-20.0, 5.0], [30.0, 5.0]])
    assert all(count(picture, KERB_COLOUR) == 0 for _, picture, _ in drawn)
    scale = MAP_HEIGHT / 104
    for watched, picture, _ in play("random", 1e-4, kerbs=(kerb,)):
        rows, columns = np.nonzero(np.all(picture[MAP] == KERB_COLOUR, axis=-1))
        assert set(rows.tolist()) == {int(MAP_HEIGHT / 2 - 5 * scale)}
        ends = PICTURE_WIDTH / 2 + scale * (kerb[:, 0] - watched.situation.sensor.x)
        assert [columns.min(), columns.max()] == pytest.approx(ends, abs=2)


def test_cells_lie_in_the_grid_in_the_colour_of_their_share(drawn):
    """A cell of 512 x 32 is a pixel wide and four high, and left is left."""
    left, top = BELOW_SIZE[0], MAP.stop + CELLS_TOP
    for watched, _, picture in drawn:
        grid = picture[top : top + 128, left : left + 512][::4, ::-1]
        for share in (EXPLOITATION, RESERVE, FLOOR):
            shown = np.all(grid == SHARE_COLOURS[share], axis=-1)
            assert (shown == (watched.shares == share)).all()
    seen = {share for watched, *_ in drawn for share in np.unique(watched.shares).tolist()}
    assert seen == {0, EXPLOITATION, RESERVE, FLOOR}


def test_forecasts_are_drawn_where_they_are_and_none_before_there_are_any(drawn):
    assert count(drawn[0][2][MAP], TRACK_COLOUR) == 0
    watched, _, picture = drawn[4]
    tracks = watched.situation.belief.tracks
    assert len(tracks) > 1
    scale = MAP_HEIGHT / 104
    for x, y in (tracks.boxes[:, :2] * scale * [1, -1]).round().astype(int).tolist():
        x, y = x + PICTURE_WIDTH // 2, y + MAP.start + MAP_HEIGHT // 2
        assert count(picture[y - 4 : y + 5, x - 4 : x + 5], TRACK_COLOUR) >= 8


def test_the_lines_of_a_camera_box_are_its_outermost_rays(drawn, drive):
    watched, _, picture = drawn[4]
    situation = watched.situation
    dimmed = np.round(0.45 * np.array(EXPLAINED_COLOUR)).astype(np.uint8)
    rows, columns = np.nonzero(np.all(picture[MAP] == dimmed, axis=-1))
    left, ahead = MAP_HEIGHT / 2 - rows, columns - PICTURE_WIDTH / 2
    # Near the car a pixel is a large angle.
    bearings = np.arctan2(left, ahead)[np.hypot(left, ahead) > 100]
    source = source_of(f"argoverse2:{drive}")
    (config,) = play_grid(source, source.scenes(), ["care"], [0.05])
    with config.make_env(config.film()) as env:
        rays = wedge_rays(situation.belief.detections, env.rig)[situation.known]
    azimuths = np.arctan2(rays[..., 1], rays[..., 0])
    outermost = np.concatenate([azimuths.min(axis=1), azimuths.max(axis=1)])
    apart = np.abs(bearings[:, None] - outermost)
    assert apart.min(axis=1).max() < 0.02
    # A line may lie under others.
    assert np.count_nonzero(apart.min(axis=0) < 0.02) >= 3
