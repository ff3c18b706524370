"""Logs with recorded sweeps, and downloads with splits."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import feather

from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Frame
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.argoverse2.recordings import (
    UP_LIDAR,
    Argoverse2,
    _bodies,
    argoverse2_film,
    logs,
)
from care_sim.sources.argoverse2.tables import read_boxes, read_points
from care_sim.sources.box_films import annotations_of
from care_sim.sources.named import source_of
from care_sim.sources.nuscenes.sweeps import owners
from tests.helpers.av2_log import CAR_AHEAD, parked, stamp

ON_THE_CAR, BESIDE_IT = (13.5, 0.2, 0.6), (13.5, 5.0, 0.6)


def swept(log, *points, keyframes=(0, 5, 10)):
    """Write a sweep of these points, in the car's frame, for every keyframe."""
    folder = log / "sensors" / "lidar"
    folder.mkdir(parents=True)
    columns = dict(zip("xyz", np.array(points, np.float16).T, strict=True))
    for number in keyframes:
        feather.write_feather(pa.table(columns), folder / f"{stamp(number)}.feather")
    return log


def test_recorded_sweeps_are_what_returns(tmp_path):
    log = swept(parked(tmp_path / "log", CAR_AHEAD, sweeps=11), ON_THE_CAR, BESIDE_IT)
    for shot in argoverse2_film(log).shots:
        ours = dict(zip(shot.cloud.objects.tolist(), shot.cloud.points, strict=True))
        assert ours[0] == pytest.approx(np.subtract(ON_THE_CAR, UP_LIDAR), abs=0.01)
        assert ours[NO_OBJECT] == pytest.approx(np.subtract(BESIDE_IT, UP_LIDAR), abs=0.01)
        assert shot.seen.objects.tolist() == [0], "pictures are those of the boxes"


def test_a_log_that_lacks_a_sweep_is_cast_at_its_boxes_and_says_so(tmp_path, capsys):
    log = swept(parked(tmp_path / "log", CAR_AHEAD, sweeps=11), ON_THE_CAR, keyframes=(0, 10))
    assert all(len(shot.cloud) > 100 for shot in argoverse2_film(log).shots)
    assert "log: 2 of 3 keyframes have a sweep" in capsys.readouterr().err


def test_a_sweep_that_changes_plays_again_and_one_that_nothing_reads_does_not(tmp_path):
    log = swept(parked(tmp_path / "log", CAR_AHEAD, sweeps=11), ON_THE_CAR)
    source = source_of(f"argoverse2:{log}")
    (scene,) = source.scenes()
    before = source.row(scene)
    feather.write_feather(pa.table({"x": [1.0]}), log / "sensors" / "lidar" / f"{stamp(1)}.feather")
    assert source.row(scene) == before
    sweep = log / "sensors" / "lidar" / f"{stamp(5)}.feather"
    feather.write_feather(
        pa.table(dict(zip("xyz", np.float16([[9], [0], [0]]), strict=True))), sweep
    )
    assert source.row(scene) != before


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ({"x": [1.0], "y": [1.0]}, "lacks the column 'z'"),
        ({"x": [1.0], "y": [np.nan], "z": [0.0]}, "'y' has a value that is not finite"),
        ({"x": [900.0], "y": [1.0], "z": [0.0]}, "'x' must lie in"),
    ],
)
def test_a_damaged_sweep_is_named(tmp_path, columns, told):
    log = swept(parked(tmp_path / "log", CAR_AHEAD, sweeps=11), ON_THE_CAR)
    feather.write_feather(pa.table(columns), log / "sensors" / "lidar" / f"{stamp(5)}.feather")
    with pytest.raises(InvalidInput, match=f"{stamp(5)}.feather: .*{told}"):
        argoverse2_film(log)


def test_a_download_with_splits_is_found(tmp_path):
    for split in ("train", "val", "test"):
        parked(tmp_path / split / f"of-{split}", CAR_AHEAD)
    assert [log.name for log in logs(tmp_path)] == ["of-train", "of-val"]
    assert Argoverse2(tmp_path, "test").scenes() == ["of-test"]
    with pytest.raises(InvalidInput, match=r"split in .* 'vall'.*train, val"):
        Argoverse2(tmp_path, "vall").scenes()


def test_a_real_sweep_has_as_many_points_in_every_box_as_are_annotated(recorded):
    """All points, whatever cells they lie in: this proves the frames of sweep and boxes."""
    log = recorded / "argoverse2" / "adcf7d18-0510-35b0-a2fa-b4cea13a6d76"
    (sweep,) = (log / "sensors" / "lidar").glob("*.feather")
    _, boxes = read_boxes(log / "annotations.feather")
    # A label of one kind: only the five classes make annotations, and all boxes are counted here.
    everything = annotations_of(
        [replace(body, label="car") for body in _bodies(boxes, int(sweep.stem))[0]]
    )
    found = owners(read_points(sweep) - UP_LIDAR, everything, Frame(0.0, 0.0, 0.0, 0.0))
    counts = [(found == number).sum() for number in everything.objects]
    assert np.array_equal(
        counts, boxes["num_interior_pts"][boxes["timestamp_ns"] == int(sweep.stem)]
    )
