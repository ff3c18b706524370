"""`care-sim study vehicle`: when the software is timed, and that timings can be written."""

import json

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.exit_codes import DONE, FAILED
from care_sim.commands.options.further_studies import Vehicle
from care_sim.commands.studies import closed_loop
from care_sim.measure.compute_path import report
from care_sim.study.episode_config import grid

SHORT = (("duration_s", 0.1),)


@pytest.fixture
def timed(monkeypatch):
    """A study of one short episode per policy, and timings on one sensor; what was timed."""
    told = []
    sensors = {name: sensor for name, sensor in report.sensors().items() if name == "hdl-32e"}
    monkeypatch.setattr(report, "sensors", lambda: told.append("timed") or sensors)
    monkeypatch.setattr(
        closed_loop,
        "vehicle_study",
        lambda seeds, also: grid(
            ["dense"], ["history", *also], [0.03], seeds, scenario_parameters=SHORT
        ),
    )
    return told


def test_timings_follow_a_study_that_was_played(timed, tmp_path):
    assert (
        closed_loop.vehicle(Vehicle(seeds=(1,), frames=1, workers=1, out=tmp_path / "out")) == DONE
    )
    assert json.loads((tmp_path / "out" / "compute-path.json").read_text())["frames"] == 1
    assert timed


def test_a_study_that_failed_is_not_followed_by_timings(timed, third_party, tmp_path):
    command = Vehicle(seeds=(1,), frames=1, workers=1, also=("raises",), out=tmp_path / "out")
    assert closed_loop.vehicle(command) == FAILED
    assert not timed
    assert not (tmp_path / "out" / "compute-path.json").exists()


def test_timings_that_cannot_be_written_stop_the_study_before_it_plays(timed, tmp_path):
    (tmp_path / "compute-path.json").mkdir()
    with pytest.raises(InvalidInput, match=r"compute-path.json is a folder"):
        closed_loop.vehicle(Vehicle(seeds=(1,), frames=1, workers=1, out=tmp_path))
    assert [each.name for each in tmp_path.iterdir()] == ["compute-path.json"]
    # Without timings the folder is as good as another.
    assert closed_loop.vehicle(Vehicle(seeds=(1,), frames=0, workers=1, out=tmp_path)) == DONE
