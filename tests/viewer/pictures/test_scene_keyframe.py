"""The picture of the open loop that says why: who appears, what was known, what each share paid."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from care_sim.core.actions import EXPLOITATION, FLOOR, RESERVE
from care_sim.envs.open_loop import OpenLoopEnv
from care_sim.envs.wrappers.watching import Watching
from care_sim.sources.named import source_of
from care_sim.study.play_config import play_grid
from care_sim.study.scene_trace import trace_scene
from care_sim.viewer.pictures.keyframe import GRID_LEFT, PANELS_TOP, PICTURE_HEIGHT, PICTURE_WIDTH
from care_sim.viewer.pictures.scene_from_above import FOUND_COLOUR, MAP_BOTTOM, pixels
from care_sim.viewer.pictures.scene_keyframe import (
    TRACK_COLOUR,
    _outermost,
    draw_scene_keyframe,
)
from care_sim.viewer.recording.entities import SHARE_COLOURS

STEPS_OUT = 5
"""The keyframe at which the person of the drive appears."""
GRID_TOP = PANELS_TOP + 44


class Drawn(Watching):
    """Draws every keyframe."""

    kinds = (OpenLoopEnv,)

    def __init__(self, env, policy, kept):
        super().__init__(env, policy)
        self._kept = kept

    def begin(self, loop, episode):
        pass

    def keep(self, watched):
        inner = self._inner
        picture = draw_scene_keyframe(inner.loop.film.name, inner.rig, watched)
        self._kept.append((watched, np.asarray(picture)))

    def end(self, outcome):
        pass


@pytest.fixture(scope="module")
def drawn(drive):
    """The keyframes of CARE in the drive, with their pictures."""
    source = source_of(f"argoverse2:{drive}")
    (config,) = play_grid(source, source.scenes(), ["care"], [0.05])
    kept = []
    trace_scene(config, config.film(), wrap=lambda env, policy: Drawn(env, policy, kept))
    return kept


def count(part, colour):
    """Pixels of a colour."""
    return int(np.all(part == colour, axis=-1).sum())


def test_every_keyframe_has_a_picture_of_one_size(drawn):
    assert len(drawn) == 10
    assert {picture.shape for _, picture in drawn} == {(PICTURE_HEIGHT, PICTURE_WIDTH, 3)}


def test_cells_lie_in_the_grid_in_the_colour_of_their_share(drawn):
    """A cell of 512 x 32 is a pixel wide and four high, and left is left."""
    for watched, picture in drawn:
        grid = picture[GRID_TOP : GRID_TOP + 128, GRID_LEFT : GRID_LEFT + 512][::4, ::-1]
        for share in (EXPLOITATION, RESERVE, FLOOR):
            shown = np.all(grid == SHARE_COLOURS[share], axis=-1)
            assert (shown == (watched.shares == share)).all()
    seen = {share for watched, _ in drawn for share in np.unique(watched.shares).tolist()}
    assert seen == {0, EXPLOITATION, RESERVE, FLOOR}


def test_forecasts_are_drawn_where_they_are_and_none_before_there_are_any(drawn):
    assert count(drawn[0][1][:MAP_BOTTOM], TRACK_COLOUR) == 0
    watched, picture = drawn[4]
    tracks = watched.situation.belief.tracks
    assert len(tracks) > 1
    for x, y in pixels(tracks.boxes[:, :2]).round().astype(int).tolist():
        near = picture[40 + y - 4 : 40 + y + 5, x - 4 : x + 5]
        assert count(near, TRACK_COLOUR) >= 8


def test_who_appears_is_named_at_that_keyframe_alone(drawn):
    """The name is written in the colour of what is found: it is seen as more of it."""
    inks = [count(picture[:MAP_BOTTOM], FOUND_COLOUR) for _, picture in drawn]
    assert inks[STEPS_OUT] > 1.5 * max(inks[:STEPS_OUT] + inks[STEPS_OUT + 1 :])


@given(
    st.floats(-np.pi, np.pi),
    st.lists(st.floats(-1.2, 1.2), min_size=1, max_size=9),
    st.floats(-0.9, 0.9),
)
@example(0.0, [1.125, 0.0, -1.0], 0.0)  # more than a quarter of a turn from the first
def test_the_outermost_rays_hold_all_others_between_them(middle, offsets, rise):
    yaws = middle + np.array(offsets)
    rays = np.column_stack([np.cos(yaws), np.sin(yaws), np.full(len(yaws), rise)])
    left, right = _outermost(rays)
    for wanted, found in ((max(offsets), left), (min(offsets), right)):
        turn = middle + wanted
        np.testing.assert_allclose(found, [np.cos(turn), np.sin(turn)], atol=1e-7)
