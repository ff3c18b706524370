"""What a folder tells of a study that has begun and not ended."""

import json

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.commands.options.studies import Sweep
from care_sim.commands.shared.command_line import command_line
from care_sim.commands.shared.run_study import run_study
from care_sim.reports.report import next_steps, read_results
from care_sim.reports.studies import SWEEP
from care_sim.study.episode_config import grid
from care_sim.study.journal import JOURNAL, UNFINISHED, Journal, Unfinished, how_far

SHORT = (("duration_s", 0.1),)


def short(policies=("history",), seeds=(0,)):
    return grid(["dartout"], policies, [0.1], seeds, scenario_parameters=SHORT)


def stopped(configs, played, folder, command="", monkeypatch=None):
    """A study of which somebody stopped all but the first tasks."""

    def few(configs, *arguments):
        run(configs[:played], *arguments)
        raise KeyboardInterrupt

    import care_sim.commands.shared.run_study as module

    run = module.run_with_progress
    monkeypatch.setattr(module, "run_with_progress", few)
    with pytest.raises(KeyboardInterrupt):
        run_study(configs, folder, workers=1, command=command)
    monkeypatch.undo()


def test_how_far_it_is_and_how_to_go_on(tmp_path, monkeypatch, capsys):
    configs, command = short(seeds=range(3)), "care-sim sweep --seeds 3"
    stopped(configs, 2, tmp_path, command, monkeypatch)
    assert f"Results go to {tmp_path}: 3 episodes\n" in capsys.readouterr().err
    told = f"{tmp_path} holds an unfinished study, sweep: 2 of 3 episodes are played"
    with pytest.raises(InvalidInput) as refused:
        read_results(tmp_path)
    assert str(refused.value) == f"{told}; to go on: {command}"
    with Journal(tmp_path / JOURNAL):
        assert how_far(tmp_path) == f"{told}, and it is being played now"
    assert run_study(configs, tmp_path, workers=1) == []
    assert not (tmp_path / UNFINISHED).exists()
    assert len(read_results(tmp_path)[0]) == 3


def test_rows_of_other_options_do_not_count(tmp_path, monkeypatch):
    run_study(short(seeds=(7,)), tmp_path, workers=1)
    stopped(short(seeds=(7, 8, 9)), 2, tmp_path, "again", monkeypatch)
    assert "2 of 3 episodes are played; to go on: again" in how_far(tmp_path)
    # Results of before are shown, with a line that not all is there.
    assert len(read_results(tmp_path)[0]) == 1
    (line,) = (one for one in next_steps(tmp_path, SWEEP) if one.startswith("Not all of it"))
    assert "2 of 3" in line


def test_a_folder_of_before_or_a_damaged_note_tells_its_rows(tmp_path):
    assert how_far(tmp_path) == ""
    run_study(short(), tmp_path, workers=1)
    line = f"{tmp_path} holds an unfinished study, 1 row; run again the command that began it"
    for text in ("{", "[]", '{"study": 3}', json.dumps({"study": "x"}), "null"):
        (tmp_path / UNFINISHED).write_text(text)
        assert how_far(tmp_path) == line
    wrong = Unfinished("sweep", "episodes", "3", 0, "")
    wrong.write(tmp_path)
    assert how_far(tmp_path) == line


def test_a_command_of_its_own_has_no_line():
    class Mine(Sweep):
        pass

    assert command_line(Mine()) == ""
