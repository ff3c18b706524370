"""The four commands of the page "Your detector", as it prints them, on 150 scenes: from tables to
the paper's Table 1, Figure 2 and Table 2.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.nuscenes_movers import KEYFRAMES, write_movers
from tests.helpers.places import EXAMPLES, ROOT

pytest.importorskip("torch")
pytestmark = [
    pytest.mark.official,
    pytest.mark.skipif(
        not (ROOT / ".venv-official" / ".installed").exists(), reason="run by make test-official"
    ),
]
SCENES = 150


def commands():
    """Those of the first block of the page, each in one line."""
    page = (ROOT / "docs" / "write" / "your-detector.md").read_text()
    block = re.search(r"^## Four commands.*?^```\n(.*?)^```$", page, re.S | re.M)[1]
    return re.sub(r"\\\n\s*", "", block).splitlines()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What an owner of nuScenes has there: data, weights, the adapter, camera boxes, a clone."""
    made = tmp_path_factory.mktemp("mine")
    write_movers(made, SCENES)
    shutil.copy(EXAMPLES / "openpcdet_detector.py", made)
    (made / "pcdet").mkdir()
    shutil.copy(ROOT / "tests" / "helpers" / "pcdet_standin.py", made / "pcdet" / "__init__.py")
    for name in ("net.yaml", "net.pth"):
        (made / name).touch()
    for name in ("Makefile", ".venv-official", "constraints-official.txt"):
        (made / name).symlink_to(ROOT / name)
    return made


def run(command, folder):
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        command, shell=True, cwd=folder, env=os.environ | {"PATH": path}, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout


def scored(folder, results):
    return json.loads((folder / f"{results}-official" / "metrics_summary.json").read_text())


def test_four_commands_go_from_tables_to_the_papers_tables(folder):
    judge, protocol, export, official = commands()
    assert re.search(r"OpenPCDet +0\.3 +100\.0 +100\.0 +100\.0 ", run(judge, folder))

    assert f"in {SCENES * KEYFRAMES} samples of {SCENES} scenes" in run(export, folder)
    run(official, folder)
    good = scored(folder, "care")
    assert good["mean_ap"] > 0.4
    assert good["meta"]["care_sim"]["sweeps"] == 10

    # Velocities are those of the network: the same boxes, driving the other way, score less.
    content = json.loads((folder / "care.json").read_text())
    for boxes in content["results"].values():
        for box in boxes:
            box["velocity"] = np.negative(box["velocity"]).tolist()
    (folder / "wrong.json").write_text(json.dumps(content))
    run(official.replace("care.json", "wrong.json"), folder)
    wrong = scored(folder, "wrong")
    assert wrong["mean_ap"] == good["mean_ap"]
    assert wrong["nd_score"] < good["nd_score"]
    assert (
        good["label_tp_errors"]["car"]["vel_err"] < 1.0 < wrong["label_tp_errors"]["car"]["vel_err"]
    )

    # The longest comes last.
    assert f"Scenes: {SCENES}, with {SCENES} first sightings" in run(protocol, folder)
    tables = (folder / "runs" / "mine" / "tables.md").read_text()
    assert "care minus each policy" in tables
    assert [*(folder / "runs" / "mine").glob("levels-*.svg")]
