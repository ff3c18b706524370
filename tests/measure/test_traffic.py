"""The loads of a keyframe: what can be reckoned by hand from the grid and the budget."""

import pytest

from care_sim.measure.traffic import loads, reset_ms

CELLS = 512 * 32
FIRED = round(0.1 * CELLS)


@pytest.fixture(scope="module")
def counted():
    return loads(1)


def test_what_hangs_on_the_grid_is_counted_as_by_hand(counted):
    stages, counts = counted
    assert counts["fired"] == FIRED
    # Scores are float32, cells 64 bits; ranges and ids are read beside them.
    assert stages["choice of cells"].memory == 4 * CELLS + 8 * FIRED
    assert stages["range image"].memory == 4 * CELLS + 24 * FIRED
    assert 0 < stages["floor"].serial <= CELLS


def test_counts_hold_together(counted):
    _, counts = counted
    assert counts["in reach"] <= counts["parts"]
    assert counts["in the picture"] <= counts["polyhedra"]
    assert counts["asked"] <= min(counts["listed"], FIRED)
    # Of a convex body one to half of the faces are turned to the camera, and rows in threes.
    assert 3 * counts["pixels"] <= counts["faces at pixels"]
    assert 0 < counts["tests"] < FIRED * counts["parts"]


def test_a_reset_takes_time():
    assert 0 < reset_ms(1) < 10_000
