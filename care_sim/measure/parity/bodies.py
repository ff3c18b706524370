"""Bodies for random scenes: those of the catalogue, the same in other sizes, and single
primitives.
"""

import numpy as np

from care_sim.core.types import CLASSES
from care_sim.world.bodies import CATALOGUE, BodyKind, Part, sized

SMALLEST_M, LARGEST_M = 0.05, 12.0
STRETCH = (0.5, 1.5)
"""Sizes of vehicles and people as shares of the catalogue's."""
GREY = (0.5, 0.5, 0.5)


def draw_kind(rng: np.random.Generator) -> BodyKind:
    """A body of any kind."""
    return [_catalogued, _resized, _primitive][rng.integers(3)](rng)


def _catalogued(rng: np.random.Generator) -> BodyKind:
    return CATALOGUE[rng.choice(sorted(CATALOGUE))]


def _resized(rng: np.random.Generator) -> BodyKind:
    label = CLASSES[rng.integers(len(CLASSES))]
    x, y, z = (np.array(CATALOGUE[label].size) * rng.uniform(*STRETCH, 3)).tolist()
    return sized(label, label, (x, y, z))


def _primitive(rng: np.random.Generator) -> BodyKind:
    x, y, z = np.exp(rng.uniform(np.log(SMALLEST_M), np.log(LARGEST_M), 3)).tolist()
    centre = tuple(rng.uniform(-1.0, 1.0, 3).tolist())
    part = [
        Part("box", (x, y, z), centre, GREY),
        Part("cylinder", (x, x, z), centre, GREY),
        Part("sphere", (x, x, x), centre, GREY),
    ][rng.integers(3)]
    return BodyKind(part.shape, None, part.size, (part,))
