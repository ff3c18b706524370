"""Columns by sample hold what the JSON tables hold."""

import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import process_time, sleep

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.sources.nuscenes import table_files
from care_sim.sources.nuscenes.recordings import NuScenes
from care_sim.sources.nuscenes.table_files import FIELDS, table_rows
from care_sim.sources.nuscenes.tables import Database
from care_sim.study.scene_play import film_hash
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
        "sample_data": [],
        "sample_annotation": [],
        "ego_pose": [],
        **tables,
    }
    (folder / "v1.0-x").mkdir()
    for name, table in rows.items():
        (folder / "v1.0-x" / f"{name}.json").write_text(json.dumps(table))
    return folder


def read(row, table):
    """The fields that are read of a row."""
    return {name: row[name] for name in ("token", *FIELDS[table])}


@given(BOX_ROWS)
def test_boxes_come_as_their_table_holds_them(boxes):
    boxes = [row | {"instance_token": row["token"]} for row in boxes]
    with tempfile.TemporaryDirectory() as folder:
        root = written(Path(folder), sample_annotation=boxes)
        for _ in ("made", "kept"):
            tables = Database(root)
            for sample in TOKENS:
                wanted = []
                for row in boxes:
                    told = read(row, "sample_annotation")
                    told["has_points"] = told.pop("num_lidar_pts") + told.pop("num_radar_pts") > 0
                    wanted += [told] if row["sample_token"] == sample else []
                assert tables.annotations(sample) == wanted


@given(RECORDINGS, POSES, st.randoms(use_true_random=False))
def test_recordings_come_with_the_poses_that_their_tables_hold(recordings, poses, chance):
    places = {row["token"]: row for row in poses}
    for row in recordings:
        if places and chance.random() < 0.7:
            row["ego_pose_token"] = chance.choice([*places])
    with tempfile.TemporaryDirectory() as folder:
        tables = Database(written(Path(folder), sample_data=recordings, ego_pose=poses))
        for sample in TOKENS:
            wanted = [
                read(row, "sample_data")
                for row in recordings
                if row["sample_token"] == sample
                and (row["is_key_frame"] or row["calibrated_sensor_token"] == "lidar")
            ]
            assert tables.recordings(sample) == wanted
            for row in wanted:
                if row["ego_pose_token"] in places:
                    assert tables.pose_of(row) == places[row["ego_pose_token"]]


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


@pytest.mark.parametrize("table", ["sample_data", "sample_annotation", "sample"])
def test_half_a_character_is_named(tmp_path, table):
    root = database(tmp_path)
    change(root, table, lambda rows: rows.append(rows[0] | {"token": "\ud800"}))
    with pytest.raises(InvalidInput, match=f"{table}.json: half a character"):
        first(root)


@pytest.fixture
def caches(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    return tmp_path / "caches"


def read_by(root):
    """The names of the tables that are read for a film."""
    read = []

    def watched(path, *needed):
        read.append(path.stem)
        return table_rows(path, *needed)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(table_files, "table_rows", watched)
        first(root)
    return read


def test_a_store_is_made_once_until_a_table_changes(tmp_path, caches):
    """Though size and time are as before."""
    root = database(tmp_path)
    assert "sample_data" in read_by(root)
    assert read_by(root) == []
    (kept,) = caches.rglob("*.sqlite")
    table = root / "v1.0-trainval" / "sample_data.json"
    before = table.stat()
    table.write_text(table.read_text())
    os.utime(table, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert "sample_data" in read_by(root)
    # Another machine may still read the one of before.
    assert len([*caches.rglob("*.sqlite")]) == 2
    assert kept.exists()


@pytest.mark.parametrize(
    "spoil", [lambda f: f.unlink(), lambda f: f.write_bytes(f.read_bytes()[:5000])]
)
def test_a_store_that_is_gone_or_damaged_is_made_again(tmp_path, caches, spoil):
    root = database(tmp_path)
    usual = first(root)
    (kept,) = caches.rglob("*.sqlite")
    spoil(kept)
    assert film_hash(first(root)) == film_hash(usual)
    assert len([*caches.rglob("*.sqlite")]) == 1


def test_a_store_that_is_deleted_while_a_process_reads_is_made_again(tmp_path, caches):
    tables = Database(database(tmp_path))
    sample = tables.samples(next(iter(tables.rows("scene").values())))[0]["token"]
    before = tables.annotations(sample)
    (kept,) = caches.rglob("*.sqlite")
    kept.unlink()
    assert tables.annotations(sample) == before
    assert kept.stat().st_size > 0


def test_where_nothing_can_be_written_every_process_makes_its_own(tmp_path, caches):
    root = database(tmp_path)
    caches.write_text("a file")
    assert "sample_data" in read_by(root)
    assert "sample_data" in read_by(root)


def test_who_wants_it_meanwhile_waits(tmp_path, caches):
    root = database(tmp_path)

    def slow(path, *needed):
        made.append(path.stem)
        sleep(0.1)
        return table_rows(path, *needed)

    made = []
    with pytest.MonkeyPatch.context() as patch, ThreadPoolExecutor(4) as pool:
        patch.setattr(table_files, "table_rows", slow)
        films = [*pool.map(lambda _: first(root), range(4))]
    assert made.count("sample_annotation") == 1
    assert len({len(film.shots) for film in films}) == 1


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
