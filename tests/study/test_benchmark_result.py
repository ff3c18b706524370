"""The result file of the benchmark: what it holds, what is refused, and the published entries."""

import json
import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.core.defaults import CELL_ORDERS
from care_sim.policies import tags_of
from care_sim.study.benchmark import result as module
from care_sim.study.benchmark.budgets import COUNTS, BudgetRow, budget_worlds
from care_sim.study.benchmark.maker import elsewhere, made_by, own_code_of
from care_sim.study.benchmark.result import (
    publish_references,
    read_result,
    references,
    with_references,
)
from care_sim.study.benchmark.suite import STREETS, Entry
from tests.helpers.made_budgets import ALWAYS, HALF_WAY, NEVER, made_budgets

MINE = "mine:Mine"


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.json"
    made_budgets(MINE, HALF_WAY).write(path)
    return path


def changed(path, **values):
    """The file with other values."""
    path.write_text(json.dumps(json.loads(path.read_text()) | values))
    return path


def refusal(path):
    with pytest.raises(InvalidInput) as refused:
        read_result(path)
    assert "\n" not in str(refused.value)
    return str(refused.value)


@pytest.mark.parametrize("curve", [ALWAYS, HALF_WAY, NEVER])
def test_a_file_holds_all_of_a_result(tmp_path, curve):
    entry = Entry("care-sector", (("residual", False),), "core-spread", "Ours")
    looking = (("file", "recall.csv"), ("levels", (1, 2)))
    given_ = {"policy_ms": (0.5, 1.25), "detector_parameters": looking}
    result = made_budgets(entry, HALF_WAY, curve, **given_)
    result.write(tmp_path / "mine.json")
    again = read_result(tmp_path / "mine.json")
    assert again == result
    assert again.score == result.score
    told = json.loads((tmp_path / "mine.json").read_text())["b90_percent"]
    assert told[0] == ("never" if math.isinf(result.score.budget) else 2.45)


@settings(max_examples=15)
@given(
    number=st.one_of(st.integers(-9, 9), st.text("ab", max_size=3)),
    given_=st.sampled_from(
        [{"quick": True, "streets": 24}, {"first": 2**31}, {"sealed": "5" * 64}]
    ),
)
def test_trials_fresh_and_sealed_results_are_read_as_they_were_written(
    tmp_path_factory, number, given_
):
    path = tmp_path_factory.mktemp("results") / "mine.json"
    first = {"first": 0} if "sealed" in given_ else {}
    result = made_budgets(Entry("mine", (("k", number),)), HALF_WAY, **given_, **first)
    result.write(path)
    assert read_result(path) == result


FULL, GOT = [1.0] * 4, [[1.0] * 4] * 7


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"care_sim_b90": 99}, "is of version 99 of the benchmark, and this is version 1"),
        ({"rows": []}, "is damaged: it has no rows"),
        ({"rows": [[STREETS, 200, [1, 2], []]]}, "is damaged: counts must be"),
        ({"rows": [[STREETS, 200, [1, 1, 1, -1], GOT]]}, "0 or more"),
        ({"rows": [["nowhere", 200, [1], [[1]] * 7]]}, "is damaged: its counts of 'nowhere'"),
        ({"rows": [[STREETS, None, FULL, GOT]]}, "name its part, and its world"),
        ({"rows": "none"}, "is damaged"),
        ({"rows": [[1]]}, "is damaged"),
        ({"parameters": 3}, "is damaged"),
        ({"policy": "a b"}, "is damaged: the policy must be a name"),
        ({"policy": 7}, "is damaged: policy, cell_order, label and detector must be texts"),
        ({"label": "a | b"}, "is damaged: the name of an entry must be"),
        ({"made_by": None}, "is damaged"),
        ({"columns": []}, "is damaged: its budgets must be"),
        ({"budgets": [0.01, 0.1]}, "is damaged: its budgets must be"),
        ({"counts": {STREETS: ["kept"]}}, "is damaged: its counts of 'streets' must be"),
        ({"rows": [[STREETS, 200, FULL, GOT]] * 2}, "holds a world of the streets twice"),
        ({"rows": [[STREETS, 201, FULL, GOT]]}, "holds other streets than the 80 worlds of"),
        (
            {
                "rows": [["recorded", "kitti/0000", FULL, GOT]],
                "counts": {"recorded": list(COUNTS[STREETS])},
            },
            "is damaged: the drive 'kitti/0000' is of the part recorded ahead, not of recorded",
        ),
        ({"quick": True}, "holds other streets than the 24 worlds of"),
        ({"sealed": "5" * 64}, "holds other streets"),
        ({"tags": ["best"]}, "has unknown tags ['best']"),
        ({"cell_order": "best"}, f"has the unknown cell_order 'best'; known: {CELL_ORDERS[0]}"),
    ],
)
def test_what_is_no_result_of_this_benchmark_is_refused_in_one_line(file, values, told):
    message = refusal(changed(file, **values))
    assert message.startswith(f"{file} ")
    assert told in message
    assert not any(word in message for word in ("Error", "object", "argument"))


def test_a_file_that_lacks_something_or_is_none_is_named(file, tmp_path):
    content = json.loads(file.read_text())
    del content["detector"]
    file.write_text(json.dumps(content))
    assert refusal(file) == f"{file} is damaged: 'detector' is missing"
    file.write_text("[" * 100_000)
    assert "cannot be read: it is nested too deep" in refusal(file)
    file.write_text("[1]")
    assert refusal(file) == f"{file} holds no result of care-sim benchmark"
    absent = tmp_path / "absent.json"
    assert refusal(absent) == f"{absent} cannot be read: No such file or directory"


def test_a_built_in_policy_has_its_own_tags_and_parameters(file):
    """Without its tag the oracle would take the first place."""
    assert read_result(changed(file, parameters=[["speed", 2]])).entry.parameters
    assert "says that history-oracle is" in refusal(changed(file, policy="history-oracle"))
    tags = tags_of("history-oracle")
    assert read_result(changed(file, tags=tags, parameters=[])).tags == tags
    told = refusal(changed(file, policy="care", tags=tags_of("care"), parameters=[["speed", 2]]))
    assert told.startswith(f"{file} cannot be played: unknown parameter of policy care 'speed'")


def test_a_result_names_the_code_and_the_files_that_made_it(tmp_path):
    weights = tmp_path / "w.txt"
    weights.write_text("1")
    entry = Entry("learned-sets", (("path", str(weights)),))
    made = made_by(entry)
    assert elsewhere(entry, made) == ""
    assert elsewhere(entry, made | {"machine": {}}).startswith("by other libraries or another")
    for other in ({"policy_code": "5"}, {"versions": {"code": "0"}}, {"versions": None}):
        assert elsewhere(entry, made | other) == "by other code than here"
    weights.write_text("2")
    assert elsewhere(entry, made) == "by other code than here"
    assert own_code_of(made_by(entry)) != own_code_of(made)
    looking = (("file", str(weights)),)
    made = made_by(entry, looking)
    assert elsewhere(entry, made, looking) == ""
    weights.write_text("3")
    assert elsewhere(entry, made, looking) == "with other files of the detector than here"


def test_published_entries_stand_beside_results_of_the_same_worlds(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_REFERENCES", tmp_path / "references")
    wide, other = made_budgets("care", HALF_WAY), made_budgets("place", ALWAYS, detector="returns")
    publish_references([wide, other])
    worlds = [(STREETS, seed) for seed in budget_worlds(quick=True)[STREETS]]
    assert references("centerpoint", worlds) == [wide.cut_to(worlds)]
    assert references("megvii", worlds) == []
    mine = made_budgets(MINE, HALF_WAY, quick=True, streets=24)
    assert with_references([mine]) == [mine, wide.cut_to(worlds)]
    # The same result stands once, another one of the name beside it; a sealed number is no seed.
    assert with_references([wide]) == [wide]
    worse = made_budgets("care", NEVER)
    assert with_references([worse]) == [worse, wide]
    assert len(with_references([replace(mine, sealed="5" * 64)])) == 1
    assert len(with_references([replace(mine, detector_parameters=(("worth", 2),))])) == 1


def test_published_entries_are_parsed_once(tmp_path, monkeypatch):
    """Every file that the leaderboard reads is compared with them."""
    monkeypatch.setattr(module, "_REFERENCES", tmp_path / "references")
    publish_references([made_budgets("care", HALF_WAY), made_budgets("place", ALWAYS)])
    parsed = []
    kept = module.result_of
    monkeypatch.setattr(module, "result_of", lambda *given: parsed.append(given) or kept(*given))
    assert references("centerpoint") == references("centerpoint")
    assert len(parsed) == 2
    publish_references([made_budgets("boxes", HALF_WAY)])
    assert [one.entry.policy for one in references("centerpoint")] == ["boxes"]


def test_numbers_that_are_no_counts_have_no_score():
    result = made_budgets("care", HALF_WAY)
    damaged = BudgetRow(STREETS, 203, (1.0,) * 4, ((math.nan,) * 4,) * 7)
    with pytest.raises(InvalidInput, match="finite"):
        replace(result, rows=(*result.rows, damaged)).score  # noqa: B018
