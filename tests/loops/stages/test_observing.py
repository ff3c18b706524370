"""Many policies together observe what each would observe alone, to the last bit."""

import numpy as np
from gymnasium.vector.utils import create_empty_array
from hypothesis import given, settings
from hypothesis import strategies as st

from care_sim.core.belief import MAX_DETECTIONS, MAX_TRACKS
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, Ego, ImageDetections, Tracks
from care_sim.envs.sensing import observation_space
from care_sim.loops.observation_limits import Limits
from care_sim.loops.stages.observing import Observing
from care_sim.loops.stages.state import State
from care_sim.sensors.pictures import CAMERA_HEIGHT, CAMERA_WIDTH, FRONT_CAMERA

RIG = Rig(cameras=(FRONT_CAMERA,))
NOWHERE = np.zeros(RIG.grid.shape, np.float32)


def detections(rng, count, reach):
    """Rows of boxes in the picture, or with a larger `reach` beyond its edges."""
    rows = np.zeros((count, len(ImageDetections.COLUMNS)))
    rows[:, ImageDetections.CLASS] = rng.integers(len(CLASSES), size=count)
    rows[:, ImageDetections.CONFIDENCE] = rng.random(count)
    corners = rng.uniform(0.5 - reach / 2, 0.5 + reach / 2, (2, count, 2))
    size = CAMERA_WIDTH, CAMERA_HEIGHT
    rows[:, ImageDetections.BOX] = np.hstack([corners.min(0) * size, corners.max(0) * size])
    return rows


def tracks(rng, count, reach):
    """Rows of tracks, the nearest first, within the limits but for a `reach` above 1."""
    rows = np.zeros((count, len(Tracks.COLUMNS)))
    rows[:, Tracks.ID] = rng.permutation(count)
    rows[:, Tracks.CLASS] = rng.integers(len(CLASSES), size=count)
    rows[:, Tracks.BOX] = rng.uniform(0.5, 2.0, (count, 7))
    rows[:, Tracks.VELOCITY] = rng.uniform(-100 * reach, 100 * reach, (count, 2))
    places = rng.uniform(-70 * reach, 70 * reach, (count, 2))
    rows[:, 2:4] = places[np.argsort(np.hypot(*places.T))]
    return rows


def told(egos, seen, known, live):
    """The observations that `Observing` writes of worlds, over ones, and those that each would get
    alone.
    """
    state = State(len(egos))
    state.live[:] = live
    state.read[:] = np.clip(egos, *Limits(RIG).ego)
    observed = create_empty_array(observation_space(RIG), len(egos), np.ones)
    tables = []
    for parts in (seen, known):
        # Rows beyond those in use mean nothing.
        rows = np.full((len(egos), max(map(len, parts)) + 2, parts[0].shape[1]), np.nan)
        for world, part in enumerate(parts):
            rows[world, : len(part)] = part
        tables.append((np.array([*map(len, parts)]), rows))
    observed["ranges"][:] = 0.0
    Observing(Limits(RIG), np.full(len(egos), RIG.budget)).write(state, *tables, observed)
    alone = [
        Limits(RIG)
        .belief(Ego(*ego), ImageDetections.from_rows(boxes), Tracks.from_rows(rows), NOWHERE)
        .to_observation()
        for ego, boxes, rows in zip(egos.tolist(), seen, known, strict=True)
    ]
    return observed, alone


DETECTED = st.sampled_from([0, 3, MAX_DETECTIONS, MAX_DETECTIONS + 1, 150])
TRACKED = st.sampled_from([0, 3, MAX_TRACKS, MAX_TRACKS + 1, 300])
REACH = st.sampled_from([1.0, 3.0])
WORLDS = st.lists(st.tuples(DETECTED, TRACKED, REACH, st.booleans()), min_size=1, max_size=3)


@settings(max_examples=60)
@given(WORLDS, st.integers(0, 10_000))
def test_each_world_is_told_what_fits(worlds, seed):
    rng = np.random.default_rng(seed)
    seen = [detections(rng, count, reach) for count, _, reach, _ in worlds]
    known = [tracks(rng, count, reach) for _, count, reach, _ in worlds]
    egos = rng.uniform(-1, 1, (len(worlds), 3)) * [150, 15, 150]
    live = np.array([plays for *_, plays in worlds])
    observed, alone = told(egos, seen, known, live)
    for world, expected in enumerate(alone):
        for name, rows in expected.items():
            if live[world]:
                assert observed[name][world].tobytes() == rows.tobytes(), name
            elif name != "ranges":
                assert (observed[name][world] == 1).all()
