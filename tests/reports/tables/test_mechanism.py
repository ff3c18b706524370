"""Tables of the mechanism on rows with known answers."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import Conditions
from care_sim.evaluation.miss_reasons import (
    ELSEWHERE,
    EXPLAINED,
    MISS_REASONS,
    NOT_DEMANDED,
    STARVED,
)
from care_sim.evaluation.ray_shares import RAY_SHARES
from care_sim.reports.tables.mechanism import mechanism_closing, mechanism_tables
from care_sim.study.mechanism_play import BELIEF_MARKS, BELIEF_SUMS, DIFFERING, RECEIVED
from care_sim.study.results_formats import MECHANISM
from care_sim.study.rows.parquet import read_rows, write_rows

FOUND = ""
WHY = "why first sightings were missed that the full scan finds"


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
    return {table.title.rpartition(": ")[2]: table for table in mechanism_tables(rows)}


def test_the_shared_belief_beside_the_paper():
    lines = {line[0]: line[1:] for line in tables()["on the belief of care"].rows}
    assert [*lines.values()] == [
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


def test_an_entry_that_the_full_scan_misses_too_is_none_that_a_reserve_would_win():
    rows = [each | {"ttfds": (0, 0, 6)} if each is ROWS[2] else each for each in ROWS]
    belief = tables(rows)["on the belief of care"].rows
    assert [line[1] for line in belief[-2:]] == ["100.0% of 1", "0"]


def test_allocations_on_it():
    assert tables()["allocations on the belief of care"].rows == (
        ("care", "", "", "", "40 [0, 50] (5)", "7 [7, 7] (1)"),
        ("history", "62.5% of 80", "", "30", "0 [0, 1] (5)", "9 [9, 9] (1)"),
        ("(paper), no camera", "", "", "", "1 to 5", "117 to 123"),
    )


def test_who_was_first_and_whose_rays_it_was():
    """CARE caught the first event of both scenes: exploitation had 3 of 4 rays of one, and none of
    the other. History caught the second of the second scene, by the floor alone.
    """
    assert tables()["events found earlier, later or at the same keyframe"].rows == (
        ("care", "history", "2", "1", "3", "17 / 8 / 79"),
    )
    assert tables()["whose rays caught what the other missed"].rows == (
        ("care", "history", "2", "38%", "62%", "0%", "0%", "0%", "1"),
        ("history", "care", "1", "0%", "0%", "0%", "0%", "100%", "0"),
    )


def test_only_misses_that_the_full_scan_finds_are_given_a_reason():
    """The full scan finds five events. Of CARE's three misses it misses one too."""
    lines = tables()[WHY].rows
    assert lines == (
        ("care", "5", "2", "0", "1", "0", "0", "1", "0"),
        ("history", "5", "3", "0", "0", "2", "0", "1", "0"),
    )


EVENTS = st.lists(
    st.tuples(st.sampled_from([0, 1, 6]), st.sampled_from(MISS_REASONS), st.sampled_from([0, 6])),
    min_size=3, max_size=3,
)  # fmt: skip


@given(EVENTS)
def test_the_reasons_add_up_to_the_misses(events):
    delays, reasons, full = zip(*events, strict=True)
    told = tuple(why if late else FOUND for late, why in zip(delays, reasons, strict=True))
    rows = [
        ROWS[0],
        row(
            "a", "mine", delays, told, (NONE,) * 5,
            differing_keyframes=0, differing_cells=0, received=NONE,
        ),
        ROWS[2] | {"ttfds": full},
    ]  # fmt: skip
    (line,) = (line for line in tables(rows)[WHY].rows if line[0] == "mine")
    missed = sum(late > 0 and found == 0 for late, found in zip(delays, full, strict=True))
    assert sum(map(int, line[3:])) == int(line[2]) == missed <= int(line[1]) == full.count(0)


def test_the_rows_survive_their_file(tmp_path):
    write_rows(ROWS, tmp_path / MECHANISM.file, "mechanism", schema=MECHANISM.schema)
    read = read_rows(tmp_path / MECHANISM.file, MECHANISM.schema)
    assert mechanism_tables(read) == mechanism_tables(ROWS)
    assert mechanism_closing(read) == ["Scenes: 2, with 6 first sightings; plays: 6."]


def test_the_paper_stands_beside_its_own_belief_and_conditions_alone():
    late = [each | {"camera_latency": 1} for each in ROWS if each["policy"] != "full"]
    led = [each | {"driver": "history"} for each in ROWS if each["policy"] == "full"]
    for rows in (late, [*led, *_driven_by_history()]):
        shown = str([(table.rows, table.quotes) for table in mechanism_tables(rows)])
        assert "79%" not in shown
        assert "17 / 8" not in shown
        assert "Paper" not in shown


def _driven_by_history():
    """The same rows with their parts on the shared belief exchanged."""
    care, history = ROWS[:2]
    own = {name: care[name] for name in (*BELIEF_SUMS, *BELIEF_MARKS)}
    moved = {name: history[name] for name in DIFFERING}
    return [
        care | dict.fromkeys(own) | moved | {"driver": "history"},
        history | own | dict.fromkeys(moved) | {"driver": "history"},
    ]


def test_full_scans_alone_show_nothing():
    assert mechanism_tables([ROWS[2]]) == []
    assert mechanism_closing([ROWS[2]]) == ["Scenes: 1, with 3 first sightings; plays: 1."]


@pytest.mark.parametrize(
    ("changed", "complaint"),
    [
        ({"received": None}, "scene a, history: received is missing"),
        ({"tracked": (0,)}, "history: tracked is missing, or not of the 3 events of the scene"),
        ({"driver": "history"}, "all rows must have one driver, got care, history"),
        ({"misses": ("bad luck", "", "")}, "unknown reason for a miss 'bad luck'"),
    ],
)
def test_rows_that_no_study_writes_are_refused(changed, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        mechanism_tables([ROWS[0], ROWS[1] | changed])


def test_a_driver_without_its_belief_is_refused():
    with pytest.raises(InvalidInput, match="scene a, care: filled is missing"):
        mechanism_tables([ROWS[0] | {"filled": None}])
