import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.belief import Belief
from care_sim.core.beliefs import Beliefs
from care_sim.core.frames import turned
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.residual import camera_layers, explained, unexplained_layer_of, wedges
from care_sim.core.rig import Rig
from care_sim.core.types import Ego, ImageDetections, Tracks
from care_sim.sensors.surround import SURROUND_CAMERAS

CAMERA = PinholeCamera()
RIG = Rig(cameras=(CAMERA,))


def box_around(point, half=5.0, camera=CAMERA):
    (pixel,), _ = camera.project([point])
    return (pixel[0] - half, pixel[1] - half, pixel[0] + half, pixel[1] + half)


def belief(detections, tracks):
    return Belief(Ego(), RIG.budget, detections, tracks, np.zeros(RIG.grid.shape, np.float32))


def test_forecasts_are_turned_back_to_when_the_picture_was_taken(tracks_at, seen):
    """The car has turned 0.2 rad left since: what is ahead now stood 0.2 rad to the left in the
    picture.
    """
    ahead = tracks_at(("car", 20, 0, 0, 0))
    then = (20 * np.cos(0.2), 20 * np.sin(0.2), -1)
    assert explained(seen(("car", *box_around(then)), yaw_change=0.2), ahead, RIG).tolist() == [
        True
    ]
    assert explained(seen(("car", *box_around(then)), yaw_change=0.0), ahead, RIG).tolist() == [
        False
    ]
    assert explained(seen(("car", *box_around(then)), yaw_change=-0.2), ahead, RIG).tolist() == [
        False
    ]


def test_wedges_are_turned_to_where_the_car_looks_now(seen):
    then = (20 * np.cos(0.2), 20 * np.sin(0.2), 0)
    (wedge,) = wedges(seen(("car", *box_around(then)), yaw_change=0.2), RIG)
    columns = np.unique(wedge % 512)
    assert 256 in columns
    assert abs(columns.mean() - 255.5) < 2


@pytest.mark.parametrize("camera", range(6))
def test_every_detection_is_judged_by_its_own_camera(tracks_at, seen, camera):
    cameras = tuple(PinholeCamera(yaw=yaw) for yaw in np.deg2rad([0, 60, 120, 180, 240, 300]))
    rig = Rig(cameras=cameras)
    x, y = 20 * np.cos(cameras[camera].yaw), 20 * np.sin(cameras[camera].yaw)
    tracks = tracks_at(("car", x, y, 0, 0), z=0.0)
    detection = seen(("car", 155, 85, 165, 95), camera=camera)
    assert explained(detection, tracks, rig).tolist() == [True]
    (wedge,) = wedges(detection, rig)
    assert rig.grid.cells_of([[x, y, 0.0]])[0] in wedge


@pytest.mark.smoke
def test_layers_part_what_memory_explains_from_what_it_does_not(tracks_at, seen):
    tracks = tracks_at(("car", 20, 2, 0, 0), ("car", 30, -6, 0, 0))
    boxes = seen(
        ("car", *box_around((20, 2, -1))),
        ("pedestrian", *box_around((15, -8, -1))),
        ("car", *box_around((30, -6, -1))),
    )
    unexplained, known = camera_layers(belief(boxes, tracks), RIG)
    alone = unexplained_layer_of(Beliefs.of(belief(boxes, tracks), RIG)).sets
    assert [cells.tolist() for cells in alone] == [cells.tolist() for cells in unexplained]
    first, second, third = (wedge.tolist() for wedge in wedges(boxes, RIG))
    assert [wedge.tolist() for wedge in unexplained] == [second]
    assert [wedge.tolist() for wedge in known] == [first, third]


def test_each_detection_is_turned_by_its_own_yaw_change(seen):
    """Two pictures of one camera, taken before and after a turn of 0.2 rad."""
    ahead, left = (155, 85, 165, 95), box_around((20 * np.cos(0.2), 20 * np.sin(0.2), 0))
    old, new = seen(("car", *left), yaw_change=0.2), seen(("car", *ahead))
    both = ImageDetections.from_rows(np.concatenate([new.rows(), old.rows()]))
    columns = [np.unique(wedge % 512).mean() for wedge in wedges(both, RIG)]
    assert columns == pytest.approx([255.5, 255.5], abs=2)


@given(st.integers(0, 2**32 - 1))
def test_a_box_is_explained_when_the_picture_of_a_forecast_of_its_class_lies_in_it(seed):
    """Eq. 2 once more, camera by camera."""
    rng = np.random.default_rng(seed)
    centres, corner = rng.uniform(-30, 30, (12, 3)) * (1, 1, 0.1), rng.uniform(-20, 300, (20, 2))
    kinds, classes = rng.integers(0, 5, 12), rng.integers(0, 5, 20)
    cameras, yaw_changes = rng.integers(0, 6, 20), rng.choice([0.0, 0.02, -0.3], 20)
    boxes = np.concatenate([corner, corner + rng.uniform(1, 200, (20, 2))], axis=1)
    detections = ImageDetections(classes, np.ones(20), boxes, cameras, np.zeros(20), yaw_changes)
    nothing = np.zeros(12, np.int64)
    tracks = Tracks(
        nothing,
        kinds,
        np.column_stack([centres, np.ones((12, 4))]),
        np.zeros((12, 2)),
        nothing,
        nothing,
    )
    for n, known in enumerate(explained(detections, tracks, Rig(cameras=SURROUND_CAMERAS))):
        pixels, _ = SURROUND_CAMERAS[cameras[n]].project(
            turned(centres[kinds == classes[n]], yaw_changes[n])
        )
        inside = np.all((boxes[n, :2] <= pixels) & (pixels <= boxes[n, 2:]), axis=1)
        assert known == inside.any()
