"""Columns by sample hold what the JSON tables hold."""

import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import process_time, sleep

import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.sources.nuscenes.recordings import NuScenes
from care_sim.sources.nuscenes.table_files import cached_table
from care_sim.sources.nuscenes.tables import Database
from tests.helpers.nuscenes_database import change
from tests.helpers.nuscenes_scene import SCENE, database, first
from tests.helpers.nuscenes_tables_of_size import BOXES, SAMPLES, TRAINVAL_SCENES, write_tables
from tests.helpers.places import ROOT

TOKENS = ["one", "two", "", "drei ü"]
NUMBERS = st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(2**60), 2**60)
NAMES = st.text(st.characters(exclude_categories=["Cs"]), max_size=5)


def rows_of(fields, most=12):
    """Rows whose tokens all differ."""
    rows = st.fixed_dictionaries({"token": NAMES, **fields})
    return st.lists(rows, max_size=most, unique_by=lambda row: row["token"])


BOX_ROWS = rows_of(
    {
        "sample_token": st.sampled_from(TOKENS),
        "visibility_token": st.sampled_from(["", "4"]),
        "translation": st.lists(NUMBERS, min_size=3, max_size=3),
        "size": st.lists(NUMBERS, min_size=3, max_size=3),
        "rotation": st.lists(NUMBERS, min_size=4, max_size=4),
        "num_lidar_pts": st.integers(0, 2),
        "num_radar_pts": st.integers(0, 2),
        "prev": NAMES,
    }
)
POSES = rows_of(
    {
        "translation": st.lists(NUMBERS, min_size=3, max_size=3),
        "rotation": st.lists(NUMBERS, min_size=4, max_size=4),
    }
)
RECORDINGS = rows_of(
    {
        "sample_token": st.sampled_from([*TOKENS, "of no sample"]),
        "ego_pose_token": NAMES,
        "calibrated_sensor_token": st.sampled_from(["lidar", "camera"]),
        "filename": NAMES,
        "is_key_frame": st.booleans(),
        "timestamp": st.integers(0, 2**62),
    }
)


def written(folder, **tables):
    sensors = {"lidar": "LIDAR_TOP", "camera": "CAM_FRONT"}
    empty = {"translation": [], "rotation": [], "camera_intrinsic": []}
    rows = {
        "sample": [{"token": t, "timestamp": 0, "next": ""} for t in TOKENS],
        "sensor": [{"token": t, "channel": name} for t, name in sensors.items()],
        "calibrated_sensor": [{"token": t, "sensor_token": t, **empty} for t in sensors],
        **tables,
    }
    (folder / "v1.0-x").mkdir()
    for name, table in rows.items():
        (folder / "v1.0-x" / f"{name}.json").write_text(json.dumps(table))
    return folder


@given(BOX_ROWS)
def test_boxes_come_as_their_table_holds_them(boxes):
    boxes = [row | {"instance_token": row["token"]} for row in boxes]
    with tempfile.TemporaryDirectory() as folder:
        root = written(Path(folder), sample_annotation=boxes)
        for _ in ("made", "mapped"):
            tables = Database(root)
            for sample in TOKENS:
                wanted = [
                    {name: row[name] for name in ("token", "instance_token", "visibility_token")}
                    | {
                        name: [*map(float, row[name])]
                        for name in ("translation", "size", "rotation")
                    }
                    | {"has_points": row["num_lidar_pts"] + row["num_radar_pts"] > 0}
                    for row in boxes
                    if row["sample_token"] == sample
                ]
                assert tables.annotations(sample) == wanted


@given(RECORDINGS, POSES, st.randoms(use_true_random=False))
def test_recordings_come_with_the_poses_that_their_tables_hold(recordings, poses, chance):
    places = {row["token"]: row for row in poses}
    for row in recordings:
        if places and chance.random() < 0.7:
            row["ego_pose_token"] = chance.choice([*places])
    with tempfile.TemporaryDirectory() as folder:
        root = written(Path(folder), sample_data=recordings, ego_pose=poses)
        for _ in ("made", "mapped"):
            tables = Database(root)
            for sample in TOKENS:
                wanted = [
                    {name: value for name, value in row.items() if name != "sample_token"}
                    | {"pose": placed(row, places)}
                    for row in recordings
                    if row["sample_token"] == sample
                    and (row["is_key_frame"] or row["calibrated_sensor_token"] == "lidar")
                ]
                assert tables.recordings(sample) == wanted


def placed(row, places):
    pose = places.get(row["ego_pose_token"])
    if pose is None:
        return None
    return {name: [*map(float, pose[name])] for name in ("translation", "rotation")}


def test_odd_numbers_are_refused_where_they_are_needed_alone(tmp_path):
    root = database(tmp_path)
    odd = {"token": "odd", "translation": [1, "2", 3], "rotation": [1, 0, 0]}
    change(root, "ego_pose", lambda rows: rows.append(rows[0] | odd))
    between = {"token": "between", "is_key_frame": False, "ego_pose_token": "odd"}
    change(root, "sample_data", lambda rows: rows.append(rows[0] | between))
    assert len(first(root).shots) == 1
    (row,) = (row for row in Database(root).recordings(f"{SCENE}-0") if row["token"] == "between")
    pose = Database(root).pose_of(row)
    with pytest.raises(InvalidInput, match="'odd' has no translation of 3 finite numbers"):
        Database(root).numbers("ego_pose", pose, "translation", 3)


@pytest.mark.parametrize(
    ("table", "edit"),
    [
        ("sample_data", {"timestamp": 10**22}),
        ("sample_data", {"filename": "\ud800"}),
        ("sample_annotation", {"instance_token": "\ud800"}),
        ("sample", {"token": "\ud800"}),
    ],
)
def test_what_no_column_holds_is_named(tmp_path, table, edit):
    root = database(tmp_path)
    change(root, table, lambda rows: rows.append(rows[0] | edit))
    with pytest.raises(InvalidInput, match=f"{table}.json: half a character or too large a number"):
        first(root)


class Maker:
    """Makes a table of a source, and counts how often."""

    def __init__(self, source):
        self.source = source
        self.made = 0

    def __call__(self):
        self.made += 1
        return pa.table({"rows": [[{"text": self.source.read_text()}], []]})

    def cached(self):
        table = cached_table(self.source.parent, "kept", [self.source], self)
        return table["rows"].to_pylist()


@pytest.fixture
def caches(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    return tmp_path / "caches"


@pytest.fixture
def maker(tmp_path, caches):
    source = tmp_path / "source.json"
    source.write_text("one")
    return Maker(source)


def kept(text):
    return [[{"text": text}], []]


def test_a_table_is_made_once_until_its_source_changes(maker):
    """Though size and time are as before."""
    assert [maker.cached() for _ in range(3)] == [kept("one")] * 3
    assert maker.made == 1
    before = maker.source.stat()
    maker.source.write_text("two")
    os.utime(maker.source, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert maker.cached() == kept("two")


@pytest.mark.parametrize("size", [0, 10, 200, -1])
def test_a_torn_table_is_made_anew(maker, caches, size):
    maker.cached()
    (place,) = caches.rglob("*.arrow")
    os.truncate(place, size if size >= 0 else place.stat().st_size - 1)
    assert [maker.cached() for _ in range(2)] == [kept("one")] * 2
    assert maker.made == 2


def test_where_nothing_can_be_written_every_process_makes_its_own(maker, caches):
    caches.write_text("a file")
    assert [maker.cached() for _ in range(2)] == [kept("one")] * 2
    assert maker.made == 2


def test_who_wants_it_meanwhile_waits(maker):
    make = maker.__call__

    def slow():
        sleep(0.2)
        return make()

    def ask(_):
        return cached_table(maker.source.parent, "kept", [maker.source], slow)

    with ThreadPoolExecutor(4) as pool:
        tables = [*pool.map(ask, range(4))]
    assert maker.made == 1
    assert all(table["rows"].to_pylist() == kept("one") for table in tables)


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
