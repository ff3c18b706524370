"""Tables of the mechanism on rows with known answers."""

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import Conditions
from care_sim.evaluation.rays import ELSEWHERE, EXPLAINED, NOT_DEMANDED, RAY_SHARES, STARVED
from care_sim.reports.tables.mechanism import mechanism_closing, mechanism_tables
from care_sim.study.mechanism_play import BELIEF_MARKS, BELIEF_SUMS, DIFFERING, RECEIVED

FOUND = ""


def row(scene, policy, ttfds, misses, rays, tracked=(0, 0, 0), **more):
    """A row of three events; `rays` are those of every share in turn."""
    full = policy == "full"
    return {
        "source": "streets",
        "scene": scene,
        "policy": policy,
        "driver": "care",
        "budget": 1.0 if full else 0.1,
        "detector": "returns",
        **vars(Conditions()),
        "film_hash": scene,
        "tags": "causal",
        "keyframes": 40,
        "ttfds": ttfds,
        "misses": misses,
        "tracked": tracked,
        **dict(zip((f"rays_{share}" for share in RAY_SHARES), rays, strict=True)),
        **dict.fromkeys((*DIFFERING, RECEIVED, *BELIEF_SUMS, *BELIEF_MARKS)),
        **more,
    }


NONE = (0, 0, 0)
ROWS = [
    row(
        "a", "care", (0, 0, 6), (FOUND, FOUND, EXPLAINED),
        ((3, 0, 0), (1, 4, 0), NONE, NONE, NONE), (1, 0, 0),
        filled=20, filled_rho=30, explained_cells=44000, untaken_cells=8000,
        pictured=(1, 1, 1), falsely_explained=(0, 0, 1), covered=(0, 0, 1), received=(40, 50, 7),
    ),
    row(
        "a", "history", (1, 0, 6), (NOT_DEMANDED, FOUND, ELSEWHERE),
        ((0, 0, 1), NONE, NONE, NONE, (0, 5, 0)),
        differing_keyframes=10, differing_cells=1000, received=(1, 3, 9),
    ),
    row("a", "full", (0, 0, 0), (FOUND,) * 3, (NONE, (4, 4, 4), NONE, NONE, NONE)),
    row(
        "b", "care", (0, 2, 6), (FOUND, ELSEWHERE, STARVED),
        ((0, 0, 0), (8, 0, 0), NONE, NONE, NONE),
        filled=40, filled_rho=40, explained_cells=36000, untaken_cells=16000,
        pictured=(1, 0, 0), falsely_explained=(0, 0, 0), covered=(0, 0, 0), received=(60, 0, 0),
    ),
    row(
        "b", "history", (6, 0, 6), (NOT_DEMANDED, FOUND, STARVED),
        (NONE, NONE, NONE, NONE, (0, 3, 0)),
        differing_keyframes=40, differing_cells=500, received=(0, 0, 0),
    ),
    row("b", "full", (0, 0, 6), (FOUND, FOUND, "too few returns"), ((NONE,) * 5)),
]  # fmt: skip


def tables(rows=ROWS):
    return {table.title.rpartition(": ")[2]: table.rows for table in mechanism_tables(rows)}


def test_the_shared_belief_beside_the_paper():
    assert [line[1:] for line in tables()["on the belief of care"]] == [
        ("75.0% of 80", "79% at 10%"),
        ("87.5% of 80", ""),
        ("1,000", "about 1,000"),
        ("300", ""),
        ("16.7% of 6", ""),
        ("66.7% of 6", ""),
        ("25.0% of 4", "32.5%"),
        ("0.0% of 1", "85%"),
        ("1", "4 at 10%"),
    ]
    # An entry that the full scan misses too is none that a reserve would win.
    rows = [each | {"ttfds": (0, 0, 6)} if each is ROWS[2] else each for each in ROWS]
    belief = tables(rows)["on the belief of care"]
    assert [line[1] for line in belief[-2:]] == ["100.0% of 1", "0"]


def test_allocations_on_it():
    assert tables()["allocations on the belief of care"] == (
        ("care", "", "", "", "40 [0, 50] (5)", "7 [7, 7] (1)"),
        ("history", "62.5% of 80", "", "30", "0 [0, 1] (5)", "9 [9, 9] (1)"),
        ("(paper), no camera", "", "", "", "1 to 5", "117 to 123"),
    )


def test_which_policy_was_first_and_whose_rays_it_was():
    """CARE caught the first event of both scenes: exploitation had 3 of 4 rays of one, and none of
    the other. History caught the second of the second scene, by the floor alone.
    """
    assert tables()["events found earlier, later or at the same keyframe"] == (
        ("care", "history", "2", "1", "3", "17 / 8 / 79"),
    )
    assert tables()["whose rays caught what the other missed"] == (
        ("care", "history", "2", "38%", "62%", "0%", "0%", "0%", "1"),
        ("history", "care", "1", "0%", "0%", "0%", "0%", "100%", "0"),
    )


def test_only_misses_that_the_full_scan_finds_are_given_a_reason():
    """The full scan finds five events. It misses one of CARE's three misses, too."""
    assert mechanism_closing(ROWS) == ["Scenes: 2, with 6 first sightings; plays: 6."]
    assert tables()["why first sightings were missed that the full scan finds"] == (
        ("care", "5", "2", "0", "1", "0", "0", "1", "0"),
        ("history", "5", "3", "0", "0", "2", "0", "1", "0"),
    )


def test_the_paper_stands_beside_its_own_belief_and_conditions_alone():
    late = [each | {"camera_latency": 1} for each in ROWS if each["policy"] != "full"]
    # A study of full scans alone has no belief.
    assert mechanism_tables([ROWS[2]]) == []
    care, history, full = ROWS[:3]
    # The parts on the shared belief exchanged.
    own = {name: care[name] for name in (*BELIEF_SUMS, *BELIEF_MARKS)}
    rows = (
        care | {name: history[name] for name in DIFFERING},
        history | own,
        full,
    )
    led = [each | {"driver": "history"} for each in rows]
    for rows in (late, led):
        shown = str([(table.rows, table.quotes) for table in mechanism_tables(rows)])
        assert not any(said in shown for said in ("79%", "17 / 8", "Paper"))


@pytest.mark.parametrize(
    ("place", "changed", "complaint"),
    [
        (0, {"filled": None}, "scene a, care: filled is missing"),
        (1, {"received": None}, "scene a, history: received is missing"),
        (1, {"tracked": (0,)}, "history: tracked is missing, or not of the 3 events of the scene"),
        (1, {"driver": "history"}, "all rows must have one driver, got care, history"),
        (1, {"misses": ("bad luck", "", "")}, "unknown reason for a miss 'bad luck'"),
    ],
)
def test_rows_that_no_study_writes_are_refused(place, changed, complaint):
    rows = ROWS[:2]
    rows[place] = rows[place] | changed
    with pytest.raises(InvalidInput, match=complaint):
        mechanism_tables(rows)
