"""Real observations round the encounter, and beliefs made by hand."""

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.core.belief import Belief
from care_sim.core.types import CLASSES, Ego, ImageDetections, Tracks

STANDING = Ego()


@pytest.fixture
def environment():
    env = gymnasium.make("CARE-Dense-v0", budget=0.05)
    yield env
    env.close()


@pytest.fixture(scope="session")
def encounter():
    """Observations of a dense street from a second before the person appears to a second after."""
    env = gymnasium.make("CARE-Dense-v0", budget=0.05)
    care = care_sim.make_policy("care", env)
    observation, _ = env.reset(seed=0)
    observations = []
    for _ in range(36):
        observations.append(observation)
        observation, *_ = env.step(care(observation))
    env.close()
    return observations[14:]


@pytest.fixture(scope="session")
def belief_of():
    """Makes a belief from rows of tracks, the ego, and a last scan."""

    def make(tracks=(), ego=STANDING, ranges=None):
        table = np.array(tracks, dtype=float).reshape(-1, len(Tracks.COLUMNS))
        nothing = ImageDetections.from_rows(np.empty((0, len(ImageDetections.COLUMNS))))
        scan = np.zeros((32, 512), np.float32) if ranges is None else ranges
        return Belief(ego, 819, nothing, Tracks.from_rows(table), scan)

    return make


@pytest.fixture(scope="session")
def car():
    """Makes the row of a tracked car, seen at the last scan."""

    def make(number, x, y=0.0, vx=0.0, vy=0.0, misses=0):
        return [number, CLASSES.index("car"), x, y, -1.0, 4.6, 1.95, 1.7, 0.0, vx, vy, misses, 2]

    return make
