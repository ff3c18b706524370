"""The sweeps between the keyframes of a nuScenes scene, which the film serves if it is told to."""

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.named import source_of
from tests.helpers.nuscenes_database import START_US, as_recorded, change, pose
from tests.helpers.nuscenes_scene import CAR, SCENE, WORLD, database, first

SEEN = np.array([[22.0, 2.0, 0.8], [30.0, -5.0, 0.1]])
"""Points in the world: at the front of CAR, and on the road."""


def swept(folder, *moments, filed=1):
    """Three keyframes, 4 m apart; before the second, sweeps at the `moments` (s), filed under the
    sample of the number.
    """
    samples = [([CAR], pose(4.0 * n), as_recorded(WORLD - [4.0 * n, 0, 0])) for n in range(3)]
    root = database(folder, samples)
    for moment in moments:
        add_sweep(root, moment, filed)
    return root


def add_sweep(root, moment, filed):
    name = f"sweep-{moment}"
    x = 8.0 * moment
    file = f"sweeps/LIDAR_TOP/{name}.pcd.bin"
    data = {"token": name, "ego_pose_token": name, "is_key_frame": False, "filename": file} | {
        "timestamp": START_US + round(moment * 1e6),
        "sample_token": f"{SCENE}-{filed}",
    }
    change(root, "sample_data", lambda rows: rows.append(rows[0] | data))
    change(root, "ego_pose", lambda rows: rows.append({"token": name} | pose(x)))
    (root / file).parent.mkdir(parents=True, exist_ok=True)
    as_recorded(SEEN - [x, 0, 0]).astype("<f4").tofile(root / file)


@pytest.mark.parametrize("filed", [0, 1, 2])
def test_the_last_before_a_keyframe_are_served_in_order_of_time_wherever_they_are_filed(
    tmp_path, filed
):
    root = swept(tmp_path, 0.3, 0.1, 0.45, 0.2, filed=filed)
    shots = first(root, sweeps=4).shots
    assert [[sweep.time_s for sweep in shot.sweeps] for shot in shots] == [
        [],
        pytest.approx([0.2, 0.3, 0.45]),
        [],
    ]
    assert [len(shot.sweeps) for shot in first(root, sweeps=10).shots] == [0, 4, 0]


def test_sweeps_before_the_first_keyframe_have_no_mask_and_are_left_out(tmp_path):
    shots = first(swept(tmp_path, -0.1, 0.2, 1.2), sweeps=10).shots
    assert [len(shot.sweeps) for shot in shots] == [0, 1, 0]


def test_a_sweep_holds_its_own_cells_and_the_points_lie_in_the_boxes_of_the_keyframe(tmp_path):
    _, shot, _ = first(swept(tmp_path, 0.25), sweeps=2).shots
    (sweep,) = shot.sweeps
    assert sweep.sensor.x == pytest.approx(shot.sensor.x - 2.0)
    assert sweep.cloud.cells.tolist() == AngularGrid().cells_of(sweep.cloud.points).tolist()
    world = sweep.sensor.origin + sweep.sensor.vectors_to_world(sweep.cloud.points)
    assert sorted(map(tuple, world.round(3))) == sorted(map(tuple, SEEN))
    on_the_car = np.isclose(world[:, 0], 22.0, atol=0.01)
    assert sweep.cloud.objects[on_the_car].tolist() == [shot.annotations.objects[0]]
    assert sweep.cloud.objects[~on_the_car].tolist() == [NO_OBJECT]


def test_sweeps_that_nobody_recorded_are_refused(tmp_path):
    with pytest.raises(
        InvalidInput,
        match=rf"sample_data.json: no LIDAR_TOP between '{SCENE}-0' and '{SCENE}-2': a film of it "
        "has one sweep a keyframe",
    ):
        first(swept(tmp_path), sweeps=10)


@pytest.mark.parametrize(
    ("source", "sweeps", "reason"),
    [
        ("streets", 10, "sweeps has no meaning for streets"),
        ("argoverse2", 10, "sweeps has no meaning for argoverse2 recordings"),
        ("nuscenes", 0, "sweeps must be a whole number >= 1"),
        ("nuscenes", True, "sweeps must be a whole number >= 1"),
        ("nuscenes", 2.5, "sweeps must be a whole number >= 1"),
    ],
)
def test_what_has_no_sweeps_refuses_them_in_one_line(tmp_path, source, sweeps, reason):
    text = source if source == "streets" else f"{source}:{tmp_path}"
    with pytest.raises(InvalidInput, match=reason):
        source_of(text, sweeps=sweeps)
