"""`care-sim study NAME`: from arguments to a folder that `report` writes again from its rows."""

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import RETURN_SETTINGS
from care_sim.reports.report import read_results
from care_sim.reports.studies import STUDIES
from care_sim.study.designs.ablations import OPEN_ABLATIONS
from care_sim.study.designs.faults import fault_study
from care_sim.study.designs.firing import FIRINGS, ORDERS
from care_sim.study.designs.realism import FILM_CONDITIONS
from tests.helpers.commands import run
from tests.helpers.made_rows import row

MADE_HERE = [level for level in FILM_CONDITIONS if not {*level.changes} & {*RETURN_SETTINGS}]
"""Conditions that a recording allows."""


@pytest.fixture
def played(capsys, tmp_path):
    """The output of a study, its rows, and the output of a report of them alone."""

    def play(line, code=0):
        out = tmp_path / "out"
        ended, printed, err = run(capsys, "study", *line.split(), "--workers", 1, "--out", out)
        assert ended == code, err
        return printed, err, out

    return play


def again(capsys, out):
    """The output of a report that writes the tables and figures again, the same ones."""
    names = {"tables.md", "tables.tex"} | {path.name for path in out.glob("*.svg")}
    before = {name: (out / name).read_bytes() for name in names}
    for name in names:
        (out / name).unlink()
    code, printed, _ = run(capsys, "report", out)
    assert code == 0
    assert {name: (out / name).read_bytes() for name in names} == before
    return printed, before


@pytest.mark.parametrize(
    ("line", "rows"),
    [
        ("order --policies history care full --budgets 0.03 0.1", len(ORDERS) * 2 * 2 + 1),
        ("firing --policies care care-units full --budgets 0.1", len(FIRINGS) * 2 + 1),
        ("realism --policies care history full --budgets 0.1", len(MADE_HERE) * 2 + 1),
        ("ablate --budgets 0.03", None),
        ("mechanism --policies care all-camera --budget 0.05", 3),
    ],
)
def test_a_log_is_played_and_reported_again(line, rows, drive, played, capsys):
    source = f" --source argoverse2:{drive.parent}"
    printed, err, out = played(line + source)
    found, study, _ = read_results(out)
    name = line.split()[0]
    assert study.name == (name if name == "mechanism" else f"{name}-open-loop")
    assert rows in (len(found), None)
    if name == "order":
        assert {row["cell_order"] for row in found if row["policy"] == "care"} == set(ORDERS)
    if name == "firing":
        # Free cells are the default, and the default has nothing in the column.
        assert {row["firing"] for row in found if row["policy"] == "care"} == {None, *FIRINGS[1:]}
    if name == "realism":
        assert "left out in argoverse2, 10%: sweep of 0.1 s (lidar_sweep_s" in err
    if name == "mechanism":
        assert [row["policy"] for row in found] == ["care", "all-camera", "full"]
        assert all(len(row["misses"]) == 1 for row in found)
        assert "Scenes: 1, with 1 first sighting; plays: 3." in printed
    if name == "ablate":
        # Forgetting alone releases cells, and more the smaller its guard.
        released = {row["policy.k_safe"]: row["released"] for row in found}
        assert released[0] > released[1] > released[None] == 0
    told, files = again(capsys, out)
    assert told in printed
    if name == "ablate":
        assert files["tables.md"].count(b"\n## care") == len(OPEN_ABLATIONS)
    # The same command goes on where it stopped: nothing is left to play.
    assert f"{len(found)} of {len(found)} " in played(line + source)[1]
    if name == "mechanism":
        assert (
            "(driver care, now all-camera), would be gone"
            in played(f"{line} --driver all-camera{source}", code=2)[1]
        )


def test_what_a_folder_or_a_log_does_not_have_is_refused(drive, played, tmp_path):
    source = f"--source argoverse2:{drive.parent}"
    assert "unknown scene 'other'" in played(f"ablate {source} --scenes other", code=2)[1]
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "episodes.parquet").touch()
    line = f"order {source} --policies full --budgets 0.1 --force"
    assert "holds episodes of another study" in played(line, code=2)[1]


def test_a_world_is_validated(played, capsys):
    line = "validate dartout --seeds 1 --training-seeds 1 --budgets 0.1 --scenario-parameters"
    more = "duration_s=0.1 occluder=truck --factors occluder_reported=True --camera-profile yolox"
    printed, _, out = played(f"{line} {more}")
    rows = read_results(out)[0]
    # The full scan asks no camera, and its rows have none in their setting.
    assert {row["camera_profile"] for row in rows if row["policy"] != "full"} >= {"yolox"}
    # Fifteen policies are chosen from; four more, and the full scan at its budget, are tested.
    assert len(rows) == 2 * (15 + 15 + 4)
    assert {row["scenario.occluder_reported"] for row in rows} == {None, True}
    assert {row["seed"] for row in rows} == {0, 10_000}
    assert "too few for a verdict." in " ".join(printed.split())
    assert again(capsys, out)[0] == printed


def test_tests_of_euro_ncap_are_played_and_told_under_conditions(played):
    line = "ncap --tests CPTAns-50 --seeds 1 --budgets 0.1 --policies care full"
    printed, _, out = played(f"{line} --camera-profile yolox")
    assert "Conditions of all episodes: camera profile yolox." in printed
    profiles = {one["policy"]: one["camera_profile"] for one in read_results(out)[0]}
    assert profiles == {"care": "yolox", "full": None}


def test_faults_under_conditions_have_the_same_tables_and_say_which():
    def tables(**common):
        rows = [row(config, 10.0 + len(config.policy)) for config in fault_study([0], **common)]
        return STUDIES["faults"].tables(rows), STUDIES["faults"].closing(rows)[1:]

    plain, nothing = tables()
    under, said = tables(camera_profile="yolox", lidar_sweep_s=0.1)
    assert (under, nothing) == (plain, [])
    assert said == ["Conditions of all episodes: camera profile yolox, lidar sweep s 0.1."]
    # A fault that grows is no condition, but for what the study starts from anyway.
    with pytest.raises(InvalidInput, match="lidar_dropout is a fault that grows"):
        fault_study([0], lidar_dropout=0.1)
    assert fault_study([0], lidar_dropout=0.0) == fault_study([0])
