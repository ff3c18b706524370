import numpy as np

from care_sim.evaluation.rays import ReserveUse, reserve_use

HULL = np.arange(0, 4)


def cells(*numbers):
    return np.array(numbers, np.int64)


def test_a_reserve_that_is_filled_by_hand():
    """Of 10 cells exploitation takes 4 of its 7. U asks for 7, one of them a hull cell, and gets
    the 6 that are left. Of M two cells lie outside U, and one of these the hull has.
    """
    unexplained = [cells(3, 10, 11, 12), cells(13, 14, 15)]
    by_memory = [cells(2, 10), cells(20, 11)]
    use = reserve_use([HULL], unexplained, by_memory, 10, 0.3)
    assert use == ReserveUse(1, filled=1, filled_rho=1, explained_cells=2, untaken_cells=1)


def test_the_reserves_own_share_is_less_than_what_exploitation_leaves():
    """Three cells are rho B, six are left."""
    use = reserve_use([HULL], [cells(10, 11, 12)], [], 10, 0.3)
    assert (use.filled, use.filled_rho) == (0, 1)
    use = reserve_use([HULL], [cells(10, 11)], [], 10, 0.3)
    assert (use.filled, use.filled_rho) == (0, 0)


def test_a_hull_cell_that_its_cap_left_out_is_not_taken():
    use = reserve_use([np.arange(30)], [], [cells(8, 29)], 10, 0.3)
    assert (use.explained_cells, use.untaken_cells) == (2, 2)
    use = reserve_use([np.arange(30)], [], [cells(6, 29)], 10, 0.3)
    assert (use.explained_cells, use.untaken_cells) == (2, 1)


def test_keyframes_add():
    assert ReserveUse(1, 1, 1, 10, 5) + ReserveUse(2, 0, 1, 1, 1) == ReserveUse(3, 1, 2, 11, 6)
