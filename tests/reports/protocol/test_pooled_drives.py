"""The examples of the page on recorded drives: drives pooled, and the rule without tracks."""

from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from care_sim.core.belief import Belief
from care_sim.core.types import ImageDetections
from care_sim.study.results_formats import PLAYS
from care_sim.study.rows.parquet import write_rows
from tests.helpers.drawn import heights
from tests.helpers.made_plays import study
from tests.helpers.places import EXAMPLES, loaded


def test_drives_of_several_folders_are_pooled_and_paired(tmp_path, capsys):
    """CARE finds 6 of 20 events per drive at once and history 3; drives of equal name stay two."""
    for number, scenes in enumerate((3, 2)):
        rows = study({"care": (6, 5), "history": (3, 5), "full": (8, 8)}, scenes=scenes)
        other = [row | {"source": "streets" if number else "nuscenes"} for row in rows]
        (tmp_path / str(number)).mkdir()
        write_rows(other, tmp_path / str(number) / PLAYS.file, "protocol", [], PLAYS.schema)
    script = loaded(EXAMPLES / "pooled_drives.py")
    folders = [str(tmp_path / n) for n in ("0", "1")]
    script.main("care", folders, str(tmp_path / "levels"))
    assert "5 recorded drives" in (tmp_path / "levels.svg").read_text()
    newcomers, _ = script.levels_figure(script.read_settings(map(Path, folders))).axes
    assert {*heights(newcomers)["history"]} == {15.0}
    printed = capsys.readouterr().out
    assert "all: 100 in 5 drives; full scan 40.0%" in printed
    assert "emerging: 35 in 5 drives; full scan 42.9%" in printed
    assert "| history | 15.0 (+15.0 [15.0, 15.0]) |" in printed
    assert "| care | 30.0 | 30.0 | 30.0 |" in printed


def test_the_rule_fires_four_cells_of_every_box_and_then_its_row():
    env = gym.make("CARE-Dartout-v0")
    belief = Belief.from_observation(env.reset(seed=0)[0])
    policy = loaded(EXAMPLES / "boxes_and_a_row.py").BoxesAndARow(env.unwrapped.rig)
    rows = [[0, 0.9, 60, 60, 80, 90, 0, 0, 0], [4, 0.9, 200, 80, 210, 110, 0, 0, 0]]
    boxes = ImageDetections.from_rows(np.array(rows, float))
    near, row = policy.demand(replace(belief, detections=boxes)).layers
    assert [len(cells) for cells in near] == [4, 4]
    directions = policy.rig.grid.directions[row[0]]
    assert np.degrees(np.arcsin(directions[:, 2])) == pytest.approx(-1.33, abs=0.01)
    assert np.all(np.diff(directions[:, 0]) <= 1e-12), "from straight ahead outwards"
