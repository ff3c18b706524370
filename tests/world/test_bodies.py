import numpy as np
import pybullet
import pytest

from care_sim.core.types import CLASSES
from care_sim.world.bodies import CATALOGUE

kinds = pytest.mark.parametrize("kind", CATALOGUE.values(), ids=CATALOGUE)


def limits(part):
    centre, half = np.array(part.centre), np.array(part.size) / 2
    return centre - half, centre + half


@kinds
def test_the_parts_fill_the_stated_size_exactly(kind):
    low = np.min([limits(part)[0] for part in kind.parts], axis=0)
    high = np.max([limits(part)[1] for part in kind.parts], axis=0)
    length, width, height = kind.size
    assert low == pytest.approx([-length / 2, -width / 2, 0])
    assert high == pytest.approx([length / 2, width / 2, height])


@kinds
def test_the_simulator_holds_a_body_of_that_size(kind, bullet):
    body = bullet.add(kind, (20.0, -3.0, 0.0))
    bullet.cast([0.0, 0.0, 1.0], np.empty((0, 3)), 50.0)  # lets PyBullet know of all bodies
    low, high = pybullet.getAABB(body, physicsClientId=bullet._client.number)
    length, width, height = kind.size
    assert low == pytest.approx([20 - length / 2, -3 - width / 2, 0], abs=1e-3)
    assert high == pytest.approx([20 + length / 2, -3 + width / 2, height], abs=1e-3)


@kinds
def test_no_part_floats_apart_from_the_rest(kind):
    """Bounding boxes of parts, joined over gaps of 10 cm (the coupling of a lorry, a stride), form
    one piece.
    """
    boxes = [limits(part) for part in kind.parts]
    joined, left = [boxes[0]], boxes[1:]
    for _ in boxes:
        near = [
            b
            for b in left
            if any(np.all(b[0] <= o[1] + 0.101) and np.all(b[1] >= o[0] - 0.101) for o in joined)
        ]
        left = [b for b in left if not any(b is n for n in near)]
        joined += near
    assert kind.label == "bicycle" or not left


@kinds
def test_labels_are_the_five_classes_or_none(kind):
    assert kind.label is None or kind.label in CLASSES


@kinds
def test_a_body_can_be_hit_from_every_side(kind, bullet):
    """Rays through the middle of every part, along x, y and z, meet the body on its own surface."""
    body = bullet.add(kind, (0.0, 0.0, 0.0))
    for part in kind.parts:
        for axis in range(3):
            direction = -np.eye(3)[axis]
            ranges, ids = bullet.cast(
                np.array(part.centre) - 90 * direction, direction[None], 100.0
            )
            assert ids.tolist() == [body]
            assert ranges[0] <= 90 - part.size[axis] / 2 + 1e-3
            assert ranges[0] >= 90 - kind.size[axis]
