"""`care-sim study validate`, from its arguments to a folder of results."""

import pytest

from care_sim.cli import main
from care_sim.reports.tables.validate import played_worlds
from care_sim.study.rows.parquet import read_rows

SHORT = (
    "validate dartout --seeds 1 --training-seeds 1 --budgets 0.1 --workers 1 "
    "--scenario-parameters duration_s=0.1 occluder=truck --factors occluder_reported=True"
)


def run(capsys, command, out):
    with pytest.raises(SystemExit) as end:
        main([*command.split(), *map(str, out)])
    return end.value.code, capsys.readouterr().out


def test_it_plays_every_world_and_its_report_is_made_again_of_the_rows(capsys, tmp_path):
    code, out = run(capsys, SHORT, ["--out", tmp_path])
    assert code == 0
    rows = read_rows(tmp_path / "episodes.parquet")
    # Fourteen policies are chosen from; four more, and the full scan at its budget, are tested.
    assert len(rows) == 2 * (14 + 14 + 4)
    assert {row["scenario.occluder_reported"] for row in rows} == {None, True}
    assert {row["seed"] for row in rows} == {0, 10_000}
    assert "dartout, duration s 0.1, occluder truck, occluder reported True" in out
    assert "too few for a verdict." in " ".join(out.split())
    assert (tmp_path / "validation.png").is_file()
    assert run(capsys, "report", [tmp_path])[1] == out


def test_a_world_with_another_camera_is_one_world_with_its_full_scan(capsys, tmp_path):
    """The full scan asks no camera, and its rows have none in their setting."""
    played = [*SHORT.split("--factors")[0].split(), "--camera-profile", "yolox"]
    code, out = run(capsys, " ".join(played), ["--out", tmp_path])
    assert code == 0
    worlds = played_worlds(read_rows(tmp_path / "episodes.parquet"))
    assert [dict(world.setting.conditions)["camera_profile"] for world in worlds] == ["yolox"]
    assert len(worlds[0].played("full", 0.1)) == 1
    assert "camera profile yolox" in out


def test_a_folder_that_another_study_holds_is_refused(capsys, tmp_path):
    (tmp_path / "plays.parquet").touch()
    assert run(capsys, SHORT, ["--out", tmp_path])[0] == 2
