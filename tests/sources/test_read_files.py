"""Everything that a source reads is part of the key of its plays."""

import json
import sys

import numpy as np
import pytest

from care_sim.base import digests
from care_sim.base.errors import InvalidInput
from care_sim.sources.named import source_of
from care_sim.sources.scenes import film_of
from care_sim.study.play_config import PlayConfig
from tests.helpers.nuscenes_database import change
from tests.helpers.nuscenes_drive import write_drive

OWN = """
from dataclasses import dataclass
from care_sim.sources.recordings import Recordings


@dataclass(frozen=True)
class Mine(Recordings):
    def scenes(self):
        return ["one"]

    def film(self, scene): ...
"""


def keys(source, **options):
    made = source_of(source, **options)
    return [PlayConfig(made, scene, "random").digest() for scene in made.scenes()]


def flip(path, at=-1):
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)


@pytest.fixture
def drive(tmp_path):
    return write_drive(tmp_path / "drive")


def test_a_byte_of_a_sweep_changes_the_plays_of_its_scene_alone(drive):
    first, other = keys(f"nuscenes:{drive}")
    flip(drive / "samples" / "LIDAR_TOP" / "scene-0103-3.pcd.bin")
    again, same = keys(f"nuscenes:{drive}")
    assert (again != first, same == other) == (True, True)


def test_a_sweep_between_keyframes_counts_where_it_is_read(drive):
    path = drive / "sweeps.bin"
    row = {"token": "between", "is_key_frame": False, "filename": path.name}
    stamps = {"scene-0103-0": 0, "scene-0103-1": 500_000, "between": 100_000}

    def add(rows):
        rows.append({**rows[0], **row})
        for one in rows:
            one["timestamp"] = stamps.get(one["token"], stamps.get(one["sample_token"], 10**6))

    change(drive, "sample_data", add)
    change(
        drive,
        "sample",
        lambda rows: [one.update(timestamp=500_000 * n) for n, one in enumerate(rows)],
    )
    path.write_bytes(np.zeros(5, "<f4").tobytes())
    one, several = (keys(f"nuscenes:{drive}", sweeps=sweeps)[0] for sweeps in (1, 2))
    flip(path)
    assert keys(f"nuscenes:{drive}")[0] == one
    assert keys(f"nuscenes:{drive}", sweeps=2)[0] != several


def test_a_table_that_changes_is_read_again_in_the_same_process(drive):
    source = source_of(f"nuscenes:{drive}")
    scene, _ = source.scenes()
    before = source.film(scene).shots[0].annotations
    change(drive, "sample_annotation", lambda rows: rows[0].update(size=[1.0, 2.0, 3.0]))
    after = source.film(scene).shots[0].annotations
    assert (before.boxes != after.boxes).any()


def test_damaged_tables_have_a_key_too(drive):
    (drive / "v1.0-trainval" / "sample_data.json").write_text("[")
    assert len(keys(f"nuscenes:{drive}")) == 2
    change(drive, "scene", lambda rows: rows[0].update(first_sample_token="nowhere"))
    assert len(keys(f"nuscenes:{drive}")) == 2


@pytest.mark.parametrize("name", ["x" * 5000, "a\0b", "\ud800", "", "../../..", "/proc"])
def test_a_file_of_any_name_has_a_key(drive, name):
    change(drive, "sample_data", lambda rows: rows[0].update(filename=name))
    source = f"nuscenes:{drive}"
    assert len(keys(source)) == 2
    with pytest.raises(InvalidInput):
        film_of(source_of(source), source_of(source).scenes()[0])


def test_camera_detections_that_change_are_read_again_in_the_same_process(drive, tmp_path):
    found = tmp_path / "found.json"
    rows = json.loads((drive / "v1.0-trainval" / "sample_data.json").read_text())
    front = next(row for row in rows if "CAM_FRONT/" in row["filename"])
    row = {"sample_data_token": front["token"], "bbox_corners": [0, 0, 9, 9], "score": 0.6}
    source = source_of(f"nuscenes:{drive}", camera_detections=found)
    counts = []
    for times in (1, 2):
        found.write_text(json.dumps([row | {"category_name": "vehicle.car"}] * times))
        film = film_of(source, source.scenes()[0])
        counts.append(sum(len(shot.seen.detections.boxes) for shot in film.shots))
    assert counts == [1, 2]


def test_own_recordings_read_their_whole_folder_unless_they_say_what(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "own_pictures.py").write_text(OWN)
    picture = tmp_path / "logs" / "one" / "picture.png"
    picture.parent.mkdir(parents=True)
    picture.write_bytes(b"a picture")
    (before,) = keys("own_pictures:Mine:logs")
    flip(picture)
    assert keys("own_pictures:Mine:logs") != [before]
    monkeypatch.setattr(digests, "MOST_FILES", 0)
    with pytest.raises(InvalidInput, match="source own_pictures:Mine: logs: a folder may hold 0"):
        keys("own_pictures:Mine:logs")
