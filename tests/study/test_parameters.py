"""Parameters are held as they are, from the task through journal and Parquet file, or refused in
one line.
"""

import enum
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.folder_checks import check_folder
from care_sim.commands.shared.run_study import run_study
from care_sim.reports.studies import SWEEP
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.journal import Journal
from care_sim.study.rows.parquet import read_rows, write_rows
from care_sim.study.rows.reading import policy_of
from care_sim.study.run_config import checked_parameters

ANYTHING = """
from care_sim.policies.paper.tracks import History

def anything(rig, **given):
    return History(rig)

def number(rig, x=1):
    return History(rig)
"""


class Colour(enum.StrEnum):
    RED = "red"


@pytest.fixture
def anything(install):
    install("anything_policy", ANYTHING, anything="anything", number="number")


@pytest.mark.parametrize(
    "value",
    [
        {1, 2},
        {"a": 1},
        b"bytes",
        None,
        float("nan"),
        np.float64("nan"),
        2**63,
        "half \ud800",
        ("half \udfff",),
        (1, "a"),
        (True, 1),
        ((1, 2), 3),
        (1, float("nan")),
        3j,
        object(),
        [[[[[[1]]]]]],
        np.array([{1}]),
        np.datetime64("2026-01-01"),
    ],
)
def test_what_no_column_gives_back_is_one_line(anything, value):
    with pytest.raises(
        InvalidInput, match="policy parameter x must be a flag, a number of at most 64 bits, a text"
    ) as e:
        EpisodeConfig("dartout", "anything", policy_parameters=(("x", value),))
    assert "\n" not in str(e.value)
    assert len(str(e.value)) < 400


@pytest.mark.parametrize("name", [3, "\ud800", b"x", None])
def test_a_parameter_has_a_name_of_text(anything, name):
    with pytest.raises(InvalidInput, match="the name of a policy parameter must be a text"):
        EpisodeConfig("dartout", "anything", policy_parameters=((name, 1),))


@pytest.mark.parametrize(
    ("value", "held"),
    [
        (np.float32(0.5), 0.5),
        (np.array([[1, 2], [3, 4]]), ((1, 2), (3, 4))),
        ([1, 2.5], (1, 2.5)),
        (Path("weights.npz"), "weights.npz"),
        (Colour.RED, "red"),
        (np.bool_(True), True),
        (float("inf"), float("inf")),
        ((), ()),
    ],
)
def test_python_types_of_everything_else(value, held):
    ((_, found),) = checked_parameters([("x", value)], "policy")
    assert found == held
    assert type(found) is type(held)


scalars = st.one_of(
    st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False), st.text(max_size=9)
)
lists = st.one_of(
    *(
        st.lists(each, max_size=3)
        for each in (st.booleans(), st.floats(allow_nan=False), st.text(max_size=5))
    ),
    st.lists(st.lists(st.integers(-9, 9), min_size=1, max_size=3), max_size=3),
)


@given(value=scalars | lists)
def test_files_give_back_what_a_task_was_given(tmp_path_factory, value):
    folder = tmp_path_factory.mktemp("held")
    row = {
        "digest": "a",
        **{f"policy.{name}": held for name, held in checked_parameters([("x", value)], "policy")},
    }
    with Journal(folder / "journal.jsonl") as journal:
        journal.append(row)
    with Journal(folder / "journal.jsonl") as journal:
        kept = journal["a"]
    write_rows([kept], folder / "rows.parquet")
    (back,) = read_rows(folder / "rows.parquet")
    assert back == kept == row
    assert hash(tuple(back.values())) == hash(tuple(row.values()))
    assert type(back["policy.x"]) is type(row["policy.x"])


def test_an_odd_policy_is_played_and_known_again(anything, tmp_path):
    odd = (("nest", [[1, 2], [3, 4]]), ("label", "a|b `c` $d$\n\x1b[31m"), ("on", True))
    configs = grid(
        ["dartout"],
        ["anything"],
        [0.1],
        [0],
        policy_parameters=odd,
        scenario_parameters=(("duration_s", 0.1),),
    )
    for _ in range(2):
        assert run_study(configs, tmp_path, workers=1) == []
    (row,) = read_rows(tmp_path / "episodes.parquet")
    assert (row["policy.nest"], row["policy.label"], row["policy.on"]) == (
        ((1, 2), (3, 4)),
        odd[1][1],
        True,
    )
    assert (
        "\x1b" not in (tmp_path / "tables.md").read_text() + (tmp_path / "tables.tex").read_text()
    )
    assert policy_of(row) in policy_of(configs[0].row())
    check_folder(tmp_path, configs, SWEEP)


def test_values_that_share_no_column_are_refused_before_anything_is_played(anything, tmp_path):
    configs = [
        EpisodeConfig("dartout", policy, policy_parameters=(("x", value),))
        for policy, value in (("anything", "text"), ("number", 3))
    ]
    with pytest.raises(
        InvalidInput,
        match=r"one column of results must hold all values of policy\.x, got 'text' and 3",
    ):
        run_study(configs, tmp_path / "out", workers=1)
    assert not (tmp_path / "out").exists()
