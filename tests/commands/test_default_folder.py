"""Where studies go for which no folder is given: none meets another."""

import pytest

from care_sim.base.errors import InvalidInput
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
    """The output and the complaints of a short sweep."""

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
    assert "care-sim report runs/sweep -o runs/sweep/report.html" in out

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


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("study validate dense --seeds 1 --training-seeds 1 --budgets 0.1", "validate-dense"),
        ("protocol --scenes 1 --policies history --budgets 0.1", "protocol-streets"),
        ("study mechanism --scenes 1", "mechanism-streets"),
    ],
)
def test_a_world_and_a_source_have_folders_of_their_own(line, name, monkeypatch, capsys):
    from care_sim.commands.shared import run_study

    def named(*arguments):
        raise InvalidInput(arguments[1].name)

    monkeypatch.setattr(run_study, "run_study", named)
    with pytest.raises(SystemExit):
        main(line.split())
    assert capsys.readouterr().err == f"care-sim: {name}\n"
