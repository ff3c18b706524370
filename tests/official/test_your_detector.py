"""The page "Your detector" walked as it stands: from a file to a table of first sightings, and from
nuScenes to the paper's Table 1, Figure 2 and Table 2.
"""

import json
import os
import re

import numpy as np
import pytest

from tests.helpers.places import ROOT, fenced

pytest.importorskip("torch")
pytest.importorskip("yaml")
from tests.helpers.detector_page import PAGE, commands, typed, write_belongings
from tests.helpers.nuscenes_movers import KEYFRAMES

pytestmark = pytest.mark.official
SCENES = int(os.environ.get("CARE_SIM_SCENES", "3"))
"""Three show a fault soon. The paper has 150, which take about half an hour."""


def scored(folder, results):
    return json.loads((folder / f"{results}-official" / "metrics_summary.json").read_text())


def rows_of(tables, title):
    """The cells behind each first one, of a measure of the table `care minus each policy`."""
    part = re.search(r"care minus each policy\n(.*?)^## ", tables, re.S | re.M)[1]
    own = re.search(rf"^\| \*{title}\*.*?\n(.*?)(?=^\| \*|^$)", part, re.S | re.M)[1]
    return {cells[1]: cells[2:-1] for cells in (re.split(r" *\| *", row) for row in own.split("\n"))
            if len(cells) > 1}  # fmt: skip


def test_a_file_has_a_table_of_first_sightings(tmp_path):
    (tmp_path / "export.py").write_text(fenced(PAGE, "py")[0])
    typed("python export.py", tmp_path)
    judge, play = commands("First table from a file")
    assert re.search(r"^torchscript +0\.3 ", typed(judge, tmp_path), re.M)
    typed(play, tmp_path)
    tables = (tmp_path / "runs" / "streets" / "tables.md").read_text()
    assert {"all-camera", "history"} < rows_of(tables, "First sightings").keys()


@pytest.mark.skipif(
    not (ROOT / ".venv-official" / ".installed").exists(), reason="run by make test-official"
)
def test_four_commands_go_from_tables_to_the_papers_tables(tmp_path):
    write_belongings(tmp_path, SCENES)
    judge, protocol, export, official = commands("Four commands on nuScenes")
    assert re.search(r"OpenPCDet +0\.3 +100\.0 +100\.0 +100\.0 ", typed(judge, tmp_path))

    assert f"in {SCENES * KEYFRAMES} samples of {SCENES} scenes" in typed(export, tmp_path)
    typed(official, tmp_path)
    good = scored(tmp_path, "care")
    assert good["mean_ap"] > 0.4
    assert good["meta"]["care_sim"]["sweeps"] == 10

    # Velocities are those of the network: the same boxes, driving the other way, score less.
    content = json.loads((tmp_path / "care.json").read_text())
    for boxes in content["results"].values():
        for box in boxes:
            box["velocity"] = np.negative(box["velocity"]).tolist()
    (tmp_path / "wrong.json").write_text(json.dumps(content))
    typed(official.replace("care.json", "wrong.json"), tmp_path)
    wrong = scored(tmp_path, "wrong")
    assert wrong["mean_ap"] == good["mean_ap"]
    assert wrong["nd_score"] < good["nd_score"]
    assert (
        good["label_tp_errors"]["car"]["vel_err"] < 1.0 < wrong["label_tp_errors"]["car"]["vel_err"]
    )

    # The longest comes last.
    assert f"Scenes: {SCENES}, with {SCENES} first sightings" in typed(protocol, tmp_path)
    tables = (tmp_path / "runs" / "mine" / "tables.md").read_text()
    assert "| care minus | 10% | 20% | 35% |" in tables
    # The newcomer drives where no track is, so only a camera or chance leads to it.
    for title, sign in (("First sightings", 1), ("Censored TTFD", -1)):
        rows = rows_of(tables, title)
        gains = [float(cell.split()[0]) * sign for cell in rows["history"]]
        assert len(gains) == 3
        assert min(gains) > 0
        assert rows.keys() > {"history-uniform", "all-camera", "uncertainty", "random"}
    (figure,) = (tmp_path / "runs" / "mine").glob("levels-nuscenes-*.svg")
    drawn = figure.read_text()
    assert all(
        f">{name}</text>" in drawn for name in ("care", "history", "all-camera", "full scan")
    )
