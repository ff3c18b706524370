"""The map of `place`: which first sightings it holds, and what each of them weighs."""

from dataclasses import replace

import numpy as np
import pytest

from care_sim.core.grid import AngularGrid
from care_sim.training.supervised.place import first_returns, sighting_map
from tests.helpers.handmade_film import BEHIND, BESIDE, BUS, WALKER, handmade_film, returns_of

GRID = AngularGrid()


def cells_at(row, columns):
    return row * GRID.columns + np.asarray(columns)


def with_fewer_returns(film, number, index, count):
    """The film with no more than `count` returns of an object at a keyframe."""
    shots = [*film.shots]
    cloud = shots[index].cloud
    kept = np.ones(len(cloud), bool)
    kept[np.flatnonzero(cloud.objects == number)[count:]] = False
    shots[index] = replace(shots[index], cloud=cloud.take(kept))
    return replace(film, shots=tuple(shots))


def test_first_sightings_that_a_full_scan_detects_at_once_are_kept_with_all_their_returns():
    found = [cells.tolist() for cells in first_returns(handmade_film(4))]
    expected = [(WALKER, 1), (BESIDE, 2), (BEHIND, 2), (BUS, 2)]
    assert sorted(found) == sorted(returns_of(*each).tolist() for each in expected)


def test_one_that_it_detects_a_keyframe_later_is_left_out():
    """Two returns of the car at its first keyframe are too few."""
    film = with_fewer_returns(handmade_film(4), BESIDE, 2, 2)
    found = [cells.tolist() for cells in first_returns(film)]
    expected = [(WALKER, 1), (BEHIND, 2), (BUS, 2)]
    assert sorted(found) == sorted(returns_of(*each).tolist() for each in expected)


def test_returns_that_one_shot_does_not_show_are_left_out():
    film = handmade_film(4)
    shots = [*film.shots]
    cloud = shots[1].cloud
    # Four shots for all but five returns of the person.
    needed = np.where(cloud.objects == WALKER, 4.0, 1.0)
    kept = np.flatnonzero(cloud.objects == WALKER)[:5]
    needed[kept] = 1.0
    shots[1] = replace(shots[1], cloud=replace(cloud, shots=needed))
    found = [cells.tolist() for cells in first_returns(replace(film, shots=tuple(shots)))]
    assert cloud.cells[kept].tolist() in found


def test_a_sighting_straight_behind_is_smoothed_over_the_seam():
    sightings = sighting_map([cells_at(9, [0])], GRID)
    assert sightings.sum() == pytest.approx(1)
    assert sightings[9, 0] == sightings.max()
    assert sightings[9, -1] == sightings[9, 1] > sightings[9, -2] == sightings[9, 2] > 0
    assert sightings[8, 0] == sightings[10, 0] > 0


def test_a_sighting_in_the_top_row_is_not_smoothed_into_the_bottom_row():
    sightings = sighting_map([cells_at(0, [256])], GRID)
    assert sightings[0, 256] == sightings.max()
    assert not sightings[GRID.rows // 2 :].any()


def test_a_sighting_of_many_cells_weighs_as_much_as_one_of_a_single_cell():
    sightings = sighting_map([cells_at(9, [100]), cells_at(9, range(300, 340))], GRID)
    left, right = np.split(sightings, [200], axis=1)
    assert left.sum() == pytest.approx(1)
    assert right.sum() == pytest.approx(1)
    assert left.max() > right.max()
