"""`care-sim study order` and `ablate`: each of one loop, and of the open one with --source."""

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.cli import main
from care_sim.commands.options.further_studies import Ablate
from care_sim.commands.shared.selection import named_after
from care_sim.commands.studies.either_loop import ablate
from care_sim.core.return_settings import RETURN_SETTINGS
from care_sim.reports.report import read_results
from care_sim.study.designs.ablations import OPEN_ABLATIONS
from care_sim.study.designs.firing import FIRINGS
from care_sim.study.designs.order import ORDERS
from care_sim.study.designs.realism import FILM_CONDITIONS


@pytest.fixture
def logs(drive):
    return f"argoverse2:{drive.parent}"


def run(*arguments):
    with pytest.raises(SystemExit) as end:
        main([*map(str, arguments)])
    return end.value.code


def written(folder):
    """Tables and figures, whatever machine or time made them."""
    names = {"tables.md", "tables.tex"} | {path.name for path in folder.glob("*.svg")}
    return {name: (folder / name).read_bytes() for name in sorted(names)}


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("study order --scenes 4", "--scenes has no meaning without --source"),
        ("study order --budgets 0.1", "--budgets has no meaning without --source"),
        ("study order --floor-seeds 2", "--floor-seeds has no meaning without --source"),
        ("study order --source streets --also random", "--also has no meaning with --source"),
        ("study order --source streets --policies", "--policies needs at least one value"),
        ("study order --source moon", "unknown source 'moon'"),
        ("study firing --budgets 0.1", "--budgets has no meaning without --source"),
        ("study firing --source streets --also random", "--also has no meaning with --source"),
        ("study firing --sensor os1-64", "--sensor has no meaning without --source"),
        (
            "study firing --source streets --sensors os1-64",
            "--sensors has no meaning with --source",
        ),
        ("study firing --sensors", "--sensors needs at least one value"),
        ("study firing --sensors os2", "unknown sensor 'os2'"),
        ("study realism --budgets 0.1", "--budgets has no meaning without --source"),
        ("study realism --source streets --seeds 3", "--seeds has no meaning with --source"),
        ("study realism --seeds 990 991", "got 990 of test and 1090 of calibration"),
        (
            "study realism --tables dense-3 --source streets",
            "--tables has no meaning with --source",
        ),
        (
            "study realism --tables dense",
            "unknown table 'dense'; the nearest is dense-5; known: cutin-10, dartout-10, ",
        ),
        ("study realism --tables", "--tables needs at least one value"),
        ("study ablate --split val", "--split has no meaning without --source"),
        ("study ablate --source streets --seeds 3", "--seeds has no meaning with --source"),
        ("study ablate --source streets --budgets", "--budgets needs at least one value"),
        ("study ablate --source streets --scenes street-0001", "unknown scene 'street-0001'"),
    ],
)
def test_an_option_of_the_other_loop_is_refused(given, told, capsys):
    assert run(*given.split()) == 2
    assert told in capsys.readouterr().err


def test_every_source_has_a_folder_of_its_own():
    assert named_after("order", "nuscenes:data") == "order-nuscenes"
    assert named_after("validate", "mine:Mine") == "validate-mine"


def test_the_orders_of_a_log_are_played_and_reported_again(logs, tmp_path, capsys):
    out = tmp_path / "out"
    asked = ("study", "order", "--source", logs, "--policies", "history", "care", "full")
    asked = (*asked, "--budgets", 0.03, 0.1, "--workers", 1, "--out", out)
    assert run(*asked) == 0
    rows, study, _ = read_results(out)
    assert study.name == "order-open-loop"
    assert len(rows) == len(ORDERS) * 2 * 2 + 1
    assert {row["cell_order"] for row in rows if row["policy"] == "care"} == set(ORDERS)
    before = written(out)
    assert "order-open-loop.svg" in before
    capsys.readouterr()

    # The same command goes on where it stopped: nothing is left to play.
    assert run(*asked) == 0
    assert f"{len(rows)} of {len(rows)} plays found" in capsys.readouterr().err
    for name in before:
        (out / name).unlink()
    assert run("report", out) == 0
    assert written(out) == before


def test_the_hardware_of_a_log_is_played_and_reported_again(logs, tmp_path, capsys):
    out = tmp_path / "out"
    asked = ("firing", "--source", logs, "--policies", "care", "care-units", "full")
    asked = (*asked, "--budgets", 0.1, "--workers", 1, "--out", out)
    assert run(*asked) == 0
    rows, study, _ = read_results(out)
    assert study.name == "firing-open-loop"
    assert len(rows) == len(FIRINGS) * 2 + 1
    # Free cells are the default, and the default has nothing in the column.
    assert {row["firing"] for row in rows if row["policy"] == "care"} == {
        None,
        *FIRINGS[1:],
    }
    before = written(out)
    (out / "tables.md").unlink()
    assert run("report", out) == 0
    assert written(out) == before


def test_the_realism_of_a_log_is_played_and_reported_again(logs, tmp_path, capsys):
    out = tmp_path / "out"
    asked = ("realism", "--source", logs, "--policies", "care", "history", "full")
    asked = (*asked, "--budgets", 0.1, "--workers", 1, "--out", out)
    assert run(*asked) == 0
    assert "left out in argoverse2, 10%: sweep of 0.1 s (lidar_sweep_s" in capsys.readouterr().err
    rows, study, _ = read_results(out)
    assert study.name == "realism-open-loop"
    played = [level for level in FILM_CONDITIONS if not {*level.changes} & {*RETURN_SETTINGS}]
    assert len(rows) == len(played) * 2 + 1
    before = written(out)
    (out / "tables.md").unlink()
    assert run("report", out) == 0
    assert written(out) == before


def test_the_ablations_of_a_log_are_played_and_reported_again(logs, tmp_path, capsys):
    out = tmp_path / "out"
    asked = ("ablate", "--source", logs, "--budgets", 0.03, "--workers", 1, "--out", out)
    assert run(*asked) == 0
    rows, study, _ = read_results(out)
    assert study.name == "ablate-open-loop"
    before = written(out)
    assert before["tables.md"].count(b"\n## care") == len(OPEN_ABLATIONS)
    (out / "tables.md").unlink()
    assert run("report", out) == 0
    assert written(out) == before
    assert "The full scan finds" in capsys.readouterr().out

    # Forgetting alone releases cells, and more the smaller its guard.
    assert {row["released"] for row in rows if row["policy"] in ("care", "history")} == {0}
    guards = {
        row["policy.k_safe"]: row["released"] for row in rows if row["policy.k_safe"] in (0, 1)
    }
    assert guards[0] > guards[1] > 0


def test_another_loop_does_not_take_the_folder(logs, tmp_path, capsys):
    (tmp_path / "episodes.parquet").touch()
    assert run("ablate", "--source", logs, "--budgets", 0.1, "--out", tmp_path, "--force") == 2
    assert "holds episodes of another study" in capsys.readouterr().err


def test_the_full_scan_alone_cannot_show_an_order(logs, tmp_path):
    out = tmp_path / "out"
    assert run("order", "--source", logs, "--policies", "full", "--workers", 1, "--out", out) == 0
    assert "## " in (out / "tables.md").read_text()


def test_no_scene_outside_the_quarter_is_played(logs):
    with pytest.raises(InvalidInput, match="unknown scene 'other'"):
        ablate(Ablate(source=logs, scenes=("other",)))
