"""No study replaces the results of another unless it is told to."""

from dataclasses import replace

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.folder_checks import check_folder
from care_sim.commands.shared.run_study import run_study
from care_sim.reports.report import StudyReport
from care_sim.reports.studies import STUDIES
from care_sim.study.episode_config import PLAIN_FIELDS, grid
from care_sim.study.journal import JOURNAL, UNFINISHED, Journal
from care_sim.study.play_config import PLAY_FIELDS
from care_sim.study.results_formats import (
    _PARAMETERS,
    EPISODES,
    MECHANISM,
    PLAYS,
    RESULTS_FORMATS,
    VEHICLE,
)
from care_sim.study.rows.parquet import read_notes, read_rows, write_rows
from tests.helpers.commands import run
from tests.helpers.made_rows import STUDY, rows

SHORT = (("duration_s", 0.1),)
NOTES = (JOURNAL, UNFINISHED)
"""Files in which a study notes its progress."""
PAPER, SWEEP = STUDIES["paper"], STUDIES["sweep"]


def short(policies=("history",), seeds=(0,), **conditions):
    return grid(["dartout"], policies, [0.1], seeds, scenario_parameters=SHORT, **conditions)


@pytest.fixture
def folder(tmp_path):
    """Results of twenty episodes of the paper's study, with figures."""
    write_rows(STUDY, tmp_path / EPISODES.file, "paper")
    StudyReport.of(STUDY, PAPER).write(tmp_path)
    (tmp_path / "dense-budget.png").write_text("a figure")
    return tmp_path


def held(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_another_study_is_refused_in_a_line_that_names_both_and_touches_nothing(folder):
    before = held(folder)
    assert any(name.endswith(".png") for name in before)
    with pytest.raises(InvalidInput) as refused:
        run_study(short(), folder, workers=1)
    told = str(refused.value)
    assert f"{folder} holds the study paper, 20 episodes, which the study sweep, 1 ep" in told
    assert "--force" in told
    assert held(folder) == before


def test_rows_that_nobody_asks_for_now_are_named(folder):
    asked = grid(["dense"], ["history", "care"], [0.03], range(5))
    with pytest.raises(InvalidInput) as refused:
        check_folder(folder, asked, PAPER)
    assert (
        "holds 20 episodes of the study paper; 10 of them, "
        "the first dense all-camera 0.03, would be gone" in str(refused.value)
    )
    whole = grid(["dense"], ["history", "all-camera", "care", "full"], [0.03], range(5))
    check_folder(folder, whole, PAPER)
    check_folder(folder, [*whole, *short()], PAPER)
    with pytest.raises(
        InvalidInput,
        match=r"; 4 of them, the first dense history 0\.03 seed 4, .* asked for, 16 episodes",
    ):
        check_folder(folder, [config for config in whole if config.seed < 4], PAPER)
    late = grid(
        ["dense"],
        ["history", "all-camera", "care", "full"],
        [0.03],
        range(5),
        camera_latencies=(1,),
    )
    # The nearest task of the name is told of, wherever it is among them.
    later = [config.changed(lidar_dropout=0.1) for config in late]
    with pytest.raises(InvalidInput, match=r"; 15 of them, .* \(camera_latency 0, now 1\), would"):
        check_folder(folder, [*later, *late], PAPER)


def test_the_same_command_goes_on_with_more_seeds_policies_and_after_changes_of_the_code(
    tmp_path, monkeypatch
):
    assert run_study(short(lidar_dead_rows=(3, 4)), tmp_path, workers=1) == []
    assert (
        run_study(short(("history", "care"), (0, 1), lidar_dead_rows=(3, 4)), tmp_path, workers=1)
        == []
    )
    monkeypatch.setattr("care_sim.study.run_config.code_digest", lambda: "edited")
    check_folder(tmp_path, short(("history", "care"), (0, 1), lidar_dead_rows=(3, 4)), SWEEP)
    with pytest.raises(InvalidInput, match=r"; 1 of them, the first dartout care 0\.1 seed 1"):
        check_folder(
            tmp_path, short(("history", "care"), (0, 1), lidar_dead_rows=(3, 4))[:3], SWEEP
        )


def test_force_replaces_at_the_end_and_keeps_the_journal(folder, tmp_path, capsys):
    line = "sweep --scenarios dartout --policies random --seeds 1 --workers 1"
    command = [*line.split(), "--scenario-parameters", "duration_s=0.1", "--out", folder]
    code, _, said = run(capsys, *command)
    assert (code, said.count("\n")) == (2, 1)
    assert "holds the study paper, 20 episodes" in said
    assert run(capsys, *command, "--force")[0] == 0
    assert read_notes(folder / EPISODES.file)[0] == "sweep"
    assert len(read_rows(folder / EPISODES.file)) == 1
    assert not [path for path in folder.iterdir() if path.suffix in (".png", ".svg")]


def test_a_study_that_cannot_be_shown_replaces_nothing(folder, monkeypatch):
    before = held(folder)

    def broken(_rows):
        raise InvalidInput("two films")

    with pytest.raises(InvalidInput, match="two films"):
        run_study(short(), folder, 1, study=replace(SWEEP, figures=broken), force=True)
    assert {name: content for name, content in held(folder).items() if name not in NOTES} == before
    with pytest.raises(InvalidInput, match="holds the study paper"):
        run_study(short(), folder, 1)


MOODY = """
from pathlib import Path
from care_sim.policies.paper.tracks import History

class Moody(History):
    files = ("mood.txt",)
    def demand(self, belief):
        if (Path(__file__).parent / "mood.txt").read_text() == "bad":
            raise RuntimeError("no")
        return super().demand(belief)
"""


def test_where_tasks_fail_fewer_rows_replace_no_more(install, tmp_path, capsys):
    """The same command after a file of the policy has changed, by which it fails."""
    install("moody_policy", MOODY, moody="Moody")
    mood, out = tmp_path / "moody_policy" / "mood.txt", tmp_path / "out"
    mood.write_text("good")
    configs = short(("history", "moody"))
    assert run_study(configs, out, workers=1) == []
    before = held(out)
    del before[JOURNAL]
    mood.write_text("bad")
    capsys.readouterr()
    (failure,) = run_study(short(("history", "moody")), out, workers=1)
    assert failure.config.policy == "moody"
    (told,) = (one for one in capsys.readouterr().err.splitlines() if "stay as they were" in one)
    assert "1 of their 2 episodes, the first dartout moody 0.1, would be gone" in told
    assert {name: content for name, content in held(out).items() if name not in NOTES} == before
    run_study(short(("history", "moody")), out, workers=1, force=True)
    assert [row["policy"] for row in read_rows(out / EPISODES.file)] == ["history"]


def test_an_interrupted_study_of_other_options_keeps_its_folder(tmp_path):
    begun = short(("history", "care"), range(3))
    with Journal(tmp_path / JOURNAL, "sweep") as journal:
        for config in begun[:4]:
            journal.append(config.row() | {"digest": f"of older code {config.key}"})
    before = held(tmp_path)
    for other, gone, what in (
        (short(seeds=(0, 1)), 2, "seed 2"),
        (short(("history", "care"), range(3), camera_latencies=(1,)), 4, "camera_latency 0, now 1"),
    ):
        told = f"holds the unfinished study sweep, 4 rows; {gone} of them, the first dart.*{what}"
        with pytest.raises(InvalidInput, match=told):
            run_study(other, tmp_path, workers=1)
    assert held(tmp_path) == before
    assert run_study(short(("history", "care"), range(4)), tmp_path, workers=1) == []


def test_an_interrupted_study_is_known_by_its_journal_beside_which_force_plays(tmp_path):
    with Journal(tmp_path / JOURNAL, "faults") as journal:
        journal.append(short()[0].row() | {"digest": "a"})
    told = "holds the unfinished study faults, 1 row, beside which the study sweep"
    with pytest.raises(InvalidInput, match=told):
        run_study(short(), tmp_path, workers=1)
    assert run_study(short(seeds=(1,)), tmp_path, workers=1, force=True) == []
    assert run_study(short(seeds=(1,)), tmp_path, workers=1) == []


def test_the_folder_is_locked_until_its_results_are_written(tmp_path, monkeypatch):
    locked = []

    def write(rows, path, *more):
        with pytest.raises(InvalidInput, match="another study writes"):
            Journal(tmp_path / JOURNAL)
        locked.append(path.name)
        write_rows(rows, path, *more)

    monkeypatch.setattr("care_sim.commands.shared.run_study.write_rows", write)
    run_study(short(), tmp_path, workers=1)
    assert locked == [EPISODES.file]


def test_made_rows_are_of_the_same_identity_as_played_ones(tmp_path):
    """A range, a parameter and a condition come back from Parquet as what was asked."""
    made = rows(
        "care-sbf",
        [3.0],
        changes={"scenario.gap_m": (0.5, 0.6), "policy.k_safe": 1, "camera_latency": 2},
    )
    write_rows(made, tmp_path / EPISODES.file)
    asked = grid(
        ["dense"],
        ["care-sbf"],
        [0.03],
        [0],
        camera_latencies=(2,),
        scenario_parameters=(("gap_m", [0.5, 0.6]),),
        policy_parameters=(("k_safe", 1.0),),
    )
    check_folder(tmp_path, asked, SWEEP)


def test_every_parameter_is_a_column_that_is_read():
    """A column that a reader drops is no part of a row's configuration."""
    known = {kind.file: {*kind.schema.needed, *kind.schema.further} for kind in RESULTS_FORMATS}
    assert {*PLAIN_FIELDS} <= known[EPISODES.file]
    # A film has its own times: the period of a keyframe is one of the closed loop.
    assert "keyframe_s" in known[EPISODES.file] & known[VEHICLE.file]
    of_plays = {*PLAY_FIELDS} | (_PARAMETERS - {*PLAIN_FIELDS, "keyframe_s"})
    assert of_plays - {"driver"} <= known[PLAYS.file]
    assert of_plays <= known[MECHANISM.file]
