"""Tight tests: which tests the full scan only just passes, and how late their brake reacts."""

from functools import partial

from hypothesis import given
from hypothesis import strategies as st

from care_sim.study.benchmark.budgets import budget_tasks, budget_worlds
from care_sim.study.benchmark.play import player_in
from care_sim.study.benchmark.suite import FIRST_SEED, TESTS, TIGHT_TESTS, Entry, tight_reactions
from tests.helpers.tight_tests import (
    LATEST_S,
    USUAL_S,
    full_scans,
    tight_reactions_of,
)


def _rows(lengths, needless, cases):
    """Rows of tests in which every reaction from the seed's length on, in tenths, collides."""
    return [
        {
            "collision": round(10 * reaction_s) >= lengths[seed],
            "braked_before_view": round(10 * reaction_s) in needless[seed],
        }
        for seed, reaction_s in cases
    ]


def test_the_brake_reacts_as_late_as_the_full_scan_can_afford():
    # Seed 0 collides always, 1 from 0.4 s on, 2 from 1.3 s on, 3 from 2 s on, 4 beyond that; 5
    # stops without need where it would be tight.
    lengths = [3, 4, 13, 20, 21, 13]
    needless = [(), (), (3, 13), (), (), (12,)]
    found = tight_reactions_of(range(6), partial(_rows, lengths, needless))
    assert found == {1: 0.3, 2: 1.2, 3: 1.9}


@given(st.lists(st.sets(st.integers(3, 20)), max_size=5))
def test_one_keyframe_more_collides_even_where_a_longer_reaction_helps(collides):
    def play(cases):
        return [
            {"collision": round(10 * late_s) in collides[seed], "braked_before_view": False}
            for seed, late_s in cases
        ]

    found = tight_reactions_of(range(len(collides)), play)
    assert [*found] == [n for n, own in enumerate(collides) if 3 not in own and 20 in own]
    for seed, reaction_s in found.items():
        tenths = round(10 * reaction_s)
        assert tenths not in collides[seed]
        assert tenths + 1 in collides[seed]


def test_the_published_tight_tests_are_those_of_the_full_scan(tmp_path):
    published = tight_reactions()
    assert all(USUAL_S <= reaction_s < LATEST_S for reaction_s in published.values())
    seeds = range(FIRST_SEED, [*published][2] + 1)
    with player_in(tmp_path, 1) as player:
        found = tight_reactions_of(seeds, partial(full_scans, player))
    assert found == {seed: published[seed] for seed in seeds if seed in published}


def test_a_tight_test_differs_from_the_test_of_its_seed_by_the_brake_alone():
    seeds = budget_worlds(closed_loop=True)[TIGHT_TESTS][:3]
    tight, usual = (
        budget_tasks(Entry("care"), part, seeds, "megvii") for part in (TIGHT_TESTS, TESTS)
    )
    for seed, own, others in zip(seeds, tight, usual, strict=True):
        for one, other in zip(own, others, strict=True):
            assert one.brake_reaction_s == tight_reactions()[seed]
            assert one == other.changed(brake_reaction_s=one.brake_reaction_s)
