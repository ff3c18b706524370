"""Where studies go for which no folder is given: none meets another."""

import re
from pathlib import Path

import pytest

from care_sim.cli import main
from care_sim.study.journal import JOURNAL, Journal
from care_sim.study.results_formats import EPISODES
from care_sim.study.rows.parquet import read_rows

SHORT = "--workers 1 --policies random --scenario-parameters duration_s=0.1"


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def sweep(capsys):
    """What a short sweep prints, and complains of."""

    def run(options, code=0):
        with pytest.raises(SystemExit) as end:
            main(f"sweep {SHORT} {options}".split())
        out, err = capsys.readouterr()
        assert end.value.code == code, err
        return out, err

    return run


def played(here, folder):
    rows = read_rows(here / "runs" / folder / EPISODES.file)
    return {(row["scenario"], row["seed"]) for row in rows}


def test_a_study_goes_on_in_its_folder_and_another_beside_it(here, sweep):
    out, err = sweep("--scenarios dartout --seeds 1")
    assert err.startswith("Results go to runs/sweep: 1 episode\n")
    assert "Results are in runs/sweep: tables.md\n" in out
    assert out.endswith(
        "Next:\n"
        "  care-sim report runs/sweep --verbose\n"
        "  care-sim report runs/sweep -o runs/sweep/report.html\n"
        "  care-sim report runs/sweep --minus POLICY\n"
    )

    _, err = sweep("--scenarios dense --seeds 1")
    assert "Results go to runs/sweep-2: " in err
    assert "because runs/sweep holds 1 episode of the study sweep; 1 of them, the first dart" in err
    assert "--force" not in err

    # More seeds of the first hold all that lies in its folder, and fewer of the second do not.
    assert (
        "Results go to runs/sweep: 2 episodes\n1 of 2" in sweep("--scenarios dartout --seeds 2")[1]
    )
    assert "Results go to runs/sweep-3: " in sweep("--scenarios dense --seeds 3 4")[1]
    assert played(here, "sweep") == {("dartout", 0), ("dartout", 1)}
    assert played(here, "sweep-2") == {("dense", 0)}
    assert played(here, "sweep-3") == {("dense", 3), ("dense", 4)}
    assert "Results go to runs/sweep: " in sweep("--scenarios cutin --seeds 1 --force")[1]
    assert played(here, "sweep") == {("cutin", 0)}


def test_a_folder_in_which_another_process_writes_is_left_alone(here, sweep):
    with Journal(here / "runs" / "sweep" / JOURNAL):
        _, err = sweep("--scenarios dartout --seeds 1")
    assert "because another study writes to runs/sweep now\nResults go to runs/sweep-2" in err


def test_a_world_and_a_source_have_folders_of_their_own(monkeypatch, capsys, tmp_path):
    from care_sim.commands.shared import run_study

    (tmp_path / "own_worlds").mkdir()
    (tmp_path / "own_worlds" / "street.py").write_text(
        "from care_sim.scenarios.dartout import Dense\n\n\nclass Street(Dense):\n    pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)

    def named(*arguments):
        raise InterruptedError(arguments[1].name)

    for line, name in (
        ("study validate dense --seeds 1 --training-seeds 1 --budgets 0.1", "validate-dense"),
        (
            "study validate own_worlds.street:Street --seeds 1 --training-seeds 1 --budgets 0.1",
            "validate-own_worlds.street",
        ),
        ("protocol --scenes 1 --policies history --budgets 0.1", "protocol-streets"),
        ("study mechanism --scenes 1", "mechanism-streets"),
        ("study ablate --source streets --scenes 1", "ablate-streets"),
        ("reproduce --seeds 1 --also", "reproduce"),
    ):
        monkeypatch.setattr(run_study, "run_study", named)
        with pytest.raises(SystemExit):
            main(line.split())
        # Who raises it here is no part of the package, and is told so.
        own = rf"InterruptedError: {re.escape(name)} \({Path(__file__).name}, line \d+\)"
        assert re.fullmatch(rf"care-sim: {own}\n", capsys.readouterr().err)


def test_a_pipe_is_eighty_columns_wide(sweep):
    out, _ = sweep("--scenarios dartout --seeds 1 --budgets 0.01 0.02 0.03 0.05 0.1 0.2")
    assert max(map(len, out.splitlines())) <= 80
    assert all(f"{budget}%" in out for budget in (1, 2, 3, 5, 10, 20))
