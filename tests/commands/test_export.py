import json

import numpy as np
import pytest

from care_sim.core.frames import turned
from care_sim.core.types import CLASSES
from tests.helpers.commands import run
from tests.helpers.nuscenes_database import change
from tests.helpers.nuscenes_drive import KEYFRAMES, OBJECTS, SPLIT, write_drive

TOKENS = [f"{scene}-{n}" for scene in SPLIT for n in range(KEYFRAMES)]


@pytest.fixture
def drive(tmp_path):
    return write_drive(tmp_path / "nuscenes")


def export(capsys, drive, out, *options):
    """Exit code, output and error lines of the command."""
    # The split that the drive holds whole, unless another is asked for.
    options = options if "--split" in options else ("--split", "mini_val", *options)
    line = ["export", "nuscenes", "--source", f"nuscenes:{drive}", "--out", out]
    return run(capsys, *line, *options)


def test_a_full_scan_finds_every_object_in_every_sample_where_it_is_and_as_fast_as_it_is(
    capsys, tmp_path, drive
):
    path = tmp_path / "new" / "full.json"
    code, out, err = export(capsys, drive, path, "--policy", "full")
    assert (code, err) == (0, "")
    boxes = len(TOKENS) * len(OBJECTS)
    assert out == f"{boxes} boxes in {len(TOKENS)} samples of 2 scenes are in {path}\n"
    content = json.loads(path.read_text())
    assert [*content["results"]] == TOKENS
    for scene, heading in SPLIT.items():
        for number in range(KEYFRAMES):
            assert seen(content["results"][f"{scene}-{number}"], heading) == pytest.approx(
                true(number), abs=1e-3
            )


def seen(found, heading):
    """(n, 5) class, place and velocity along and across the drive, in order."""
    places = turned(np.array([box["translation"][:2] for box in found]), -heading)
    velocities = turned(np.array([box["velocity"] for box in found]), -heading)
    return in_order([CLASSES.index(box["detection_name"]) for box in found], places, velocities)


def true(number):
    """The same of the objects; the first keyframe tells no velocity."""
    speeds = np.array([velocity for _, _, velocity, _, _ in OBJECTS])
    places = np.array([place for _, place, _, _, _ in OBJECTS]) + 0.5 * number * speeds
    return in_order([CLASSES.index(name) for name, *_ in OBJECTS], places, speeds * (number > 0))


def in_order(classes, places, velocities):
    rows = np.column_stack([classes, places, velocities])
    return rows[np.lexsort((places[:, 0].round(2), classes))]


def test_the_origin_is_told(capsys, tmp_path, drive):
    (tmp_path / "found.json").write_text("[]")
    options = "--policy care-sbf --policy-parameters k_safe=1.5 --budget 0.2 --floor-seed 2"
    options = [*options.split(), "--camera-latency", 1]
    options += ["--camera-detections", tmp_path / "found.json"]
    export(capsys, drive, tmp_path / "out.json", *options)
    meta = json.loads((tmp_path / "out.json").read_text())["meta"]
    own = meta.pop("care_sim")
    assert meta == {
        "use_camera": True, "use_lidar": True, "use_radar": False, "use_map": False,
        "use_external": False,
    }  # fmt: skip
    assert (own["policy"], own["policy.k_safe"], own["budget"]) == ("care-sbf", 1.5, 0.2)
    assert (own["floor_seed"], own["camera_latency"]) == (2, 1)
    assert (own["split"], own["detector"], own["source"]) == ("mini_val", "returns", "nuscenes")
    assert str(tmp_path) not in json.dumps(own)
    assert len(own["camera_detections"]) == 16, "a hash of the file"


def test_samples_in_which_nothing_is_found_are_there_and_a_file_without_a_box_is_told(
    capsys, tmp_path, drive
):
    code, _, err = export(
        capsys, drive, tmp_path / "out.json", "--policy", "random", "--budget", "0.0005"
    )
    assert code == 0
    assert err == "care-sim: the official devkit refuses results without a box\n"
    assert json.loads((tmp_path / "out.json").read_text())["results"] == {
        token: [] for token in TOKENS
    }


def test_a_damaged_scene_ends_it_since_the_devkit_asks_for_every_sample(capsys, tmp_path, drive):
    change(drive, "sample_data", lambda rows: rows[-7].update(filename="samples/gone.bin"))
    code, _, err = export(capsys, drive, tmp_path / "out.json")
    assert (code, err.count("\n")) == (2, 1)
    assert "samples/gone.bin: no such file" in err
    assert not (tmp_path / "out.json").exists()
