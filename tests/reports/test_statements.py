"""Statements about two entries under several detectors, by results made by hand."""

import pytest

from care_sim.reports.statements import (
    TIED,
    TURNS_OVER,
    UNDER_ALL,
    UNDER_MOST,
    columns_table,
    statement,
    statements_table,
)
from care_sim.reports.table import Bold
from tests.helpers.made_budgets import ALWAYS, HALF_WAY, NEVER, made_budgets

LATE = (0.1, 0.2, 0.3, 0.8, 1.0, 1.0, 1.0)
BETTER, ALIKE, WORSE, NOBODY = (HALF_WAY, LATE), (LATE, LATE), (LATE, HALF_WAY), (NEVER, NEVER)


def columns_of(*pairs, streets=5):
    """Curves of `care` and of `boxes` under the detectors a, b, c and so on."""
    return {
        name: [
            made_budgets("care", ours, detector=name, streets=streets),
            made_budgets("boxes", theirs, detector=name, streets=streets),
        ]
        for name, (ours, theirs) in zip("abcde", pairs, strict=False)
    }


@pytest.mark.parametrize(
    ("pairs", "verdict", "told"),
    [
        ((BETTER, BETTER, BETTER), UNDER_ALL, "under all"),
        ((BETTER, BETTER, ALIKE), UNDER_MOST, "under most: fewer under a, b; tied under c"),
        ((BETTER, ALIKE, ALIKE), TIED, "tied: fewer under a; tied under b, c"),
        # Half of the detectors are not most of them.
        ((BETTER, ALIKE), TIED, "tied: fewer under a; tied under b"),
        ((ALIKE, NOBODY), TIED, "tied"),
        (
            (BETTER, BETTER, BETTER, WORSE),
            TURNS_OVER,
            "turns over: fewer under a, b, c; more under d",
        ),
    ],
)
def test_what_detectors_say_of_two_entries(pairs, verdict, told):
    found = statement(columns_of(*pairs), "care", "boxes")
    assert (found.first, found.second) == ("care", "boxes")
    assert (found.verdict, str(found)) == (verdict, told)


def test_who_needs_fewer_under_more_detectors_comes_first():
    found = statement(columns_of(WORSE, WORSE, ALIKE), "care", "boxes")
    assert (found.first, found.second, found.verdict) == ("boxes", "care", UNDER_MOST)
    assert found.fewer == ("a", "b")
    turned = statement(columns_of(BETTER, WORSE, WORSE), "care", "boxes")
    assert (turned.first, turned.fewer, turned.more) == ("boxes", ("b", "c"), ("a",))


def test_the_table_has_the_pairs_and_then_the_neighbours_each_once():
    columns = columns_of(BETTER, WORSE, NOBODY)
    for name, results in columns.items():
        results.append(made_budgets("place", NEVER, detector=name))
    table = statements_table(columns, [("place", "care")])
    assert table.columns[2:] == ("holds", "a", "b", "c")
    assert [tuple(map(str, row)) for row in table.rows] == [
        (
            "care",
            "place",
            "under most: fewer under a, b; tied under c",
            "other never",
            "other never",
            "both never",
        ),
        (
            "care",
            "boxes",
            "turns over: fewer under a; more under b; tied under c",
            "0.63 [0.63, 0.63]",
            "1.58 [1.58, 1.58]",
            "both never",
        ),
        (
            "boxes",
            "place",
            "under most: fewer under a, b; tied under c",
            "other never",
            "other never",
            "both never",
        ),
    ]
    assert isinstance(table.rows[1][3], Bold)
    assert not isinstance(table.rows[1][5], Bold)
    assert "3 detectors, 5 worlds" in table.title


def test_detectors_are_compared_in_the_worlds_that_all_have():
    columns = columns_of(BETTER) | {"z": columns_of(WORSE, streets=7)["a"]}
    assert "5 worlds" in statements_table(columns).title
    table = columns_table(columns)
    assert table.columns == ("policy", "a", "z")
    assert table.rows == (
        ("care", "2.4 [2.4, 2.4]", "3.9 [3.9, 3.9]"),
        ("boxes", "3.9 [3.9, 3.9]", "2.4 [2.4, 2.4]"),
    )


def test_an_entry_that_always_has_enough_needs_fewer():
    found = statement(columns_of((ALWAYS, LATE)), "care", "boxes")
    assert found.verdict == UNDER_ALL
