"""`care-sim report FOLDER -o FILE`: what it writes, and the one line it says where it cannot."""

import pytest

from care_sim.cli import main
from care_sim.commands.options.results import Report
from care_sim.study.episode_config import grid
from care_sim.study.episode_play import run_episode
from care_sim.study.rows.parquet import write_rows
from tests.helpers.made_rows import STUDY

SHORT = {"scenario_parameters": (("duration_s", 0.2),)}


def report(capsys, *arguments):
    """Exit code, output and errors."""
    with pytest.raises(SystemExit) as end:
        main(["report", *map(str, arguments)])
    return end.value.code, *capsys.readouterr()


@pytest.fixture
def results(tmp_path):
    folder = tmp_path / "results"
    folder.mkdir()
    write_rows(STUDY, folder / "episodes.parquet")
    return folder


def test_a_page_is_written_and_the_folder_left_alone(results, tmp_path, capsys):
    path = tmp_path / "deep" / "report.html"
    code, out, err = report(capsys, results, "-o", path, "--episodes", 0)
    assert code == 0
    assert out.startswith(f"{path}: 0.")
    assert out.endswith("MB, 0 episodes to watch\n")
    assert "config.json is missing" in err
    page = path.read_text()
    assert page.startswith("<!doctype html>")
    assert "No episode was played again for this page" in page
    assert [file.name for file in results.iterdir()] == ["episodes.parquet"]


def test_few_episodes_are_played_again_and_how_to_get_all_is_told(tmp_path, capsys):
    folder = tmp_path / "results"
    folder.mkdir()
    rows = [run_episode(config) for config in grid(["dartout"], ["random"], [0.1], [0, 1], **SHORT)]
    write_rows(rows, folder / "episodes.parquet")
    made = [folder, "-o", tmp_path / "report.html", "--workers", 1]
    code, out, err = report(capsys, *made, "--episodes", 1)
    assert (code, "1 episode to watch" in out) == (0, True)
    assert "playing 1 episode again to be watched (--episodes 2: all)\n" in err
    assert "playing 2 episodes again to be watched\n" in report(capsys, *made)[2]
    assert Report(folders=(folder,)).episodes == 40


def test_the_same_results_make_the_same_page(results, tmp_path, capsys):
    for name in ("one.html", "two.html", "two.html"):
        report(capsys, results, "-o", tmp_path / name, "--episodes", 0)
    assert (tmp_path / "one.html").read_bytes() == (tmp_path / "two.html").read_bytes()
