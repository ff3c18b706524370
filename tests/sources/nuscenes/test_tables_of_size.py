"""Tables as long as all of nuScenes load in a gigabyte, in not much more than their parsing."""

import json
import subprocess
import sys
from time import process_time

import pytest

from care_sim.sources.nuscenes.recordings import NuScenes
from tests.helpers.nuscenes_tables_of_size import BOXES, SAMPLES, TRAINVAL_SCENES, write_tables
from tests.helpers.places import ROOT

MOST_PARSES = 2.5
MOST_MB = 1000
PART_SCENES = TRAINVAL_SCENES // 20
LOAD = """
import json, sys
from pathlib import Path
from time import perf_counter, process_time
from care_sim.sources.nuscenes.recordings import NuScenes
from care_sim.study.episode_play import peak_rss_mb

start, busy = perf_counter(), process_time()
source = NuScenes(Path(sys.argv[1]), split="all")
film = source.film(source.scenes()[0])
times = {"seconds": perf_counter() - start, "busy_s": process_time() - busy}
print(json.dumps(times | {"peak_mb": peak_rss_mb(), "keyframes": len(film.shots)}))
"""


def test_the_first_scene_plays_of_tables_of_any_length(tmp_path):
    source = NuScenes(write_tables(tmp_path, 1), split="all")
    shots = source.film("scene-0001").shots
    assert [len(shot.annotations) for shot in shots] == [BOXES] * SAMPLES
    assert [len(shot.cloud) for shot in shots] == [1] * SAMPLES


@pytest.mark.speed
def test_all_of_trainval_loads_in_a_gigabyte_and_little_more_than_its_text_parses(tmp_path):
    """Beside `json.loads` of the same text, so that the machine's speed does not matter; of a part
    of it, for the values of all the text at once take ten gigabytes.
    """
    part = write_tables(tmp_path / "part", PART_SCENES) / "v1.0-trainval"
    parsing = min(parsing_s(part) for _ in range(3)) * TRAINVAL_SCENES / PART_SCENES
    root = write_tables(tmp_path / "all", TRAINVAL_SCENES)
    for process in ("first", "later"):
        loaded = in_a_process(root) | {"parsing_s": parsing}
        print(process, loaded)
        assert loaded["keyframes"] == SAMPLES
        assert loaded["busy_s"] < MOST_PARSES * parsing
        assert loaded["peak_mb"] < MOST_MB


def parsing_s(folder):
    """Seconds of a core that the standard library takes for the text of all tables."""
    start = process_time()
    for path in folder.glob("*.json"):
        json.loads(path.read_bytes())
    return process_time() - start


def in_a_process(root):
    """How long a process of its own takes to its first film, and its most memory."""
    command = [sys.executable, "-c", LOAD, str(root)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)
