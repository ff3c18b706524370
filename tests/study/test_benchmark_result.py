"""The result file of the benchmark: what its score is, and what is refused."""

import json
import re
from dataclasses import replace
from math import comb

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.defaults import CELL_ORDERS
from care_sim.policies import tags_of
from care_sim.study.benchmark.play import ONE_IN
from care_sim.study.benchmark.result import is_of_this_code, made_by, own_code_of, read_result
from care_sim.study.benchmark.suite import (
    BENCHMARK_VERSION,
    PARTS,
    SIZES,
    STREETS,
    Entry,
    published_worlds,
)
from tests.helpers.made_results import made_result
from tests.helpers.places import PUBLISHED, ROOT

SEAL = "5" * 64


def changed(path, **values):
    """The file with other values."""
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | values))
    return path


def refusal(path):
    with pytest.raises(InvalidInput) as refused:
        read_result(path)
    assert "\n" not in str(refused.value)
    return str(refused.value)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.json"
    made_result().write(path)
    return path


def test_all_of_the_reachable_is_one_hundred_and_nothing_is_nothing():
    assert made_result(share=1).score() == (100, 100, 100)
    assert made_result(share=0).score() == (0, 0, 0)


def test_the_score_is_the_mean_of_three_shares():
    """Half of the drives, half of the tests, and on streets what the first half of them holds."""
    result = made_result(share=0.5)
    streets = [row.reachable for row in result.of_part(STREETS, "measured")]
    expected = 100 * sum(streets[: len(streets) // 2]) / sum(streets)
    assert [result.part_score(part) for part in PARTS] == [50, 50, expected]
    mean, low, high = result.score()
    assert mean == pytest.approx((100 + expected) / 3)
    assert 35 < low < mean < high < 65


def test_a_street_weighs_by_what_a_full_scan_finds_in_it():
    result = made_result(share=0)
    rich = max(result.of_part(STREETS, "measured"), key=lambda row: row.reachable)
    found = tuple(
        row._replace(reached=row.reachable) if row is rich else row for row in result.rows
    )
    of_all = sum(row.reachable for row in result.of_part(STREETS, "measured"))
    score = replace(result, rows=found).part_score(STREETS)
    assert score == pytest.approx(100 * rich.reachable / of_all)


def test_a_lead_is_paired_by_world():
    """One world of every part apart, whatever the others hold: nearly certain."""
    ours, theirs = made_result(share=0.5), made_result(share=0.49)
    mean, low, high = ours.lead(theirs)
    assert 0 <= low < mean < high < 4
    assert ours.score().high - ours.score().low > 2 * (high - low)
    assert ours.lead(ours) == (0, 0, 0)


@settings(max_examples=15)
@given(share=st.floats(0, 1), parameter=st.one_of(st.integers(-9, 9), st.text("ab", max_size=3)))
def test_a_file_gives_back_what_was_written(tmp_path_factory, share, parameter):
    path = tmp_path_factory.mktemp("results") / "mine.json"
    result = made_result(share=share, tags=("causal", "learned"), made_by={"machine": "here"})
    result = replace(result, entry=Entry("mine", (("k", parameter),), "core-spread"))
    result.write(path)
    assert read_result(path) == result


def test_a_row_is_a_line(file):
    lines = file.read_text().splitlines()
    assert sum(line.startswith('  ["') for line in lines) == len(made_result().rows)


@pytest.mark.parametrize("version", [0, BENCHMARK_VERSION + 1, "one"])
def test_another_version_is_refused_with_the_command_that_plays_it_again(file, version):
    told = refusal(changed(file, care_sim_benchmark=version))
    assert f"version {version!r} of the benchmark, this care-sim scores version 1" in told
    assert "care-sim benchmark --policy mine" in told


def test_a_score_that_was_written_in_changes_nothing(file):
    changed(file, score={"measured": {"score": 99.9}})
    assert read_result(file).score() == made_result().score()


@pytest.mark.parametrize(
    "spoil",
    [
        lambda rows: rows[::-1],
        lambda rows: [*rows, rows[0]],
        lambda rows: [[*rows[0][:2], 3, *rows[0][3:]], *rows[1:]],
        lambda rows: [[*rows[0][:4], 2, rows[0][5]], *rows[1:]],
    ],
)
def test_other_worlds_are_refused(file, spoil):
    rows = json.loads(file.read_text())["rows"]
    assert "holds other worlds than version 1" in refusal(changed(file, rows=spoil(rows)))


@pytest.mark.parametrize("lost", [slice(0, 1), slice(5, 8), slice(0, None, 2)])
def test_missing_rows_are_counted(file, lost):
    rows = json.loads(file.read_text())["rows"]
    missing, number = len(rows[lost]), len(rows)
    del rows[lost]
    told = f"{file} lacks {missing:,} of the {number:,} rows of version 1 of the benchmark: play it"
    assert refusal(changed(file, rows=rows)).startswith(told)


def test_a_trial_is_played_again_as_a_trial(tmp_path):
    path = tmp_path / "mine.quick.json"
    made_result().cut_to_tenth().write(path)
    rows = json.loads(path.read_text())["rows"]
    told = "play it again with care-sim benchmark --quick --policy mine"
    assert refusal(changed(path, rows=rows[1:])).endswith(told)


@pytest.mark.parametrize(
    "values",
    [
        {"rows": [[1]]},
        {"rows": 3},
        {"columns": []},
        {"policy": 7},
        {"parameters": [["a"]]},
        {"rows": [["drives", "measured", -1, 0, 1, "h"]]},
        {"rows": [["drives", "measured", 201, 0.5, 1, "h"]]},
        {"rows": [["drives", "measured", 201, 0, 0, "h"]]},
        {"made_by": None},
        {"made_by": [1]},
        {"rows": [[{}, [], 1, 0, 1, "h"]]},
        {"rows": [["drives", "measured", 201, 2, 1, "h"]]},
        {"policy": "# care"},
        {"policy": "<b>care</b>"},
        {"policy": "math:pi|"},
        {"label": "a | b"},
        {"label": "a\nb"},
        {"label": "long" * 40},
        {"parameters": [["k", "<img src=x>"]]},
    ],
)
def test_a_damaged_file_is_named(file, values):
    told = refusal(changed(file, **values))
    assert told.startswith(f"{file} is damaged: ")
    assert not any(word in told for word in ("Error", "object", "argument", "\n"))


def test_a_parameter_that_a_built_in_policy_lacks_is_refused(file):
    """What another policy has is that policy's own word."""
    assert read_result(changed(file, parameters=[["speed", 2]])).entry.parameters
    assert refusal(changed(file, policy="care")).startswith(
        f"{file}: unknown parameter of policy care 'speed'"
    )


def test_an_unknown_order_of_cells_is_refused(file):
    assert read_result(changed(file, cell_order=CELL_ORDERS[-1])).entry.cell_order
    known = ", ".join(CELL_ORDERS)
    told = refusal(changed(file, cell_order="best"))
    assert told == f"{file} has the unknown cell_order 'best'; known: {known}"


def test_what_a_damaged_file_lacks_is_named(file):
    content = json.loads(file.read_text())
    del content["policy"]
    file.write_text(json.dumps(content))
    assert refusal(file) == f"{file} is damaged: 'policy' is missing"


@pytest.mark.parametrize("n", [2, 3, 4])
def test_an_endless_number_is_refused_in_one_line(file, n):
    rows = json.loads(file.read_text())["rows"]
    changed(file, rows=[[*rows[0][:n], "ENDLESS", *rows[0][n + 1 :]], *rows[1:]])
    file.write_text(file.read_text().replace('"ENDLESS"', "1e999"))
    assert "a row must hold whole numbers" in refusal(file)


def test_a_built_in_policy_has_its_own_tags_and_nobody_others_than_there_are(tmp_path, file):
    """Without its tag the oracle would take the first place."""
    path = tmp_path / "oracle.json"
    made_result("history-oracle", tags=("causal",)).write(path)
    assert "history-oracle" in refusal(path)
    assert "it is" in refusal(path)
    made_result("history-oracle").write(path)
    assert read_result(path).tags == tags_of("history-oracle")
    assert "unknown tags ['best']" in refusal(changed(file, tags=["best"]))


def test_an_entry_shows_the_name_of_a_file_and_not_where_it_lies():
    entry = Entry("mine:Mine", (("weights", "/home/me/w.npz"), ("maps", ("a/b.npz", "c"))))
    assert entry.name == "mine:Mine weights=w.npz maps=('b.npz', 'c')"
    assert "/home/me/w.npz" in entry.full_name
    assert replace(entry, parameters=(), label="Ours").name == "Ours (mine:Mine)"


def test_a_result_is_of_the_files_that_its_parameters_name(tmp_path):
    weights = tmp_path / "w.txt"
    weights.write_text("1")
    entry = Entry("learned-sets", (("path", str(weights)),))
    result = replace(made_result("learned-sets"), entry=entry, made_by=made_by(entry))
    result.write(tmp_path / "mine.json")
    assert is_of_this_code(read_result(tmp_path / "mine.json"))
    weights.write_text("2")
    assert not is_of_this_code(result)
    assert own_code_of(replace(result, made_by=made_by(entry))) != own_code_of(result)


def test_a_result_is_of_the_code_of_its_policy(tmp_path):
    made = made_by(Entry("care"))
    assert is_of_this_code(made_result("care", made_by=made))
    assert not is_of_this_code(made_result("care", made_by=made | {"policy_code": "5"}))
    assert not is_of_this_code(made_result("care"))


@pytest.mark.parametrize(
    "path",
    sorted((PUBLISHED / "leaderboard").glob("*.json")),
    ids=lambda path: path.stem,
)
def test_the_results_of_this_repository_can_be_read(path):
    assert read_result(path).rows


def test_what_is_no_result_is_named(tmp_path):
    path = tmp_path / "mine.json"
    assert refusal(path) == f"{path} cannot be read: No such file or directory"
    path.write_text('{"rows": [')
    assert refusal(path).startswith(f"{path} is cut off or no JSON: Expecting value: line 1")
    path.write_text("[" * 300 + "]" * 300)
    assert "cannot be read: it is nested deeper" in refusal(path)
    path.write_text("[1]")
    assert "holds no result of care-sim benchmark" in refusal(path)


def test_a_trial_is_read_as_one_and_a_whole_is_cut_to_it(tmp_path):
    whole = made_result(share=0.04)
    trial = whole.cut_to_tenth()
    assert [trial.part_score(part) for part in PARTS[:2]] == [50, pytest.approx(500 / 12)]
    trial.write(tmp_path / "mine.json")
    assert read_result(tmp_path / "mine.json") == trial
    assert trial.cut_to_tenth() is trial


def test_a_sealed_result_holds_no_seed_and_must_be_whole(tmp_path):
    worlds = [world._replace(number=n) for n, world in enumerate(published_worlds())]
    sealed = made_result(sealed=SEAL, worlds=worlds)
    sealed.write(tmp_path / "mine.json")
    assert read_result(tmp_path / "mine.json").sealed == SEAL
    made_result(sealed=SEAL, worlds=worlds[1:]).write(tmp_path / "less.json")
    assert "lacks sealed worlds" in refusal(tmp_path / "less.json")


@pytest.mark.parametrize("spoil", [lambda own: [own[0], *own[:-1]], lambda own: own[::-1]])
def test_the_numbers_of_sealed_worlds_ascend(tmp_path, spoil):
    """One good world, told again and again, would make a score."""
    worlds = [world._replace(number=n) for n, world in enumerate(published_worlds())]
    streets = [world for world in worlds if world.part == STREETS]
    others = [world for world in worlds if world.part != STREETS]
    made_result(sealed=SEAL, worlds=[*others, *spoil(streets)]).write(tmp_path / "mine.json")
    assert "must ascend" in refusal(tmp_path / "mine.json")


def test_the_page_tells_how_often_made_up_rows_pass():
    """Drawn without being put back, of the rows that make the score."""
    rows = sum(SIZES.values())
    drawn = -(-rows // ONE_IN["measured"])
    assert drawn + -(-rows // ONE_IN["ideal"]) == 2 * rows // 10
    page = (ROOT / "docs" / "benchmark.md").read_text()
    told = re.findall(r"^\| (\d+) \| ([\d.,]+) times \|$", page, re.M)
    assert len(told) == 3
    for made_up, times in told:
        chance = comb(rows - int(made_up), drawn) / comb(rows, drawn)
        assert float(times.replace(",", "")) == pytest.approx(1 / chance, rel=0.01)
    ten = comb(rows - 10, drawn) / comb(rows, drawn)
    assert f"three calls once in {ten**-3:.0f} times" in page
