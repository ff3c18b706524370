import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.core.types import CLASSES, Ego
from care_sim.envs.open_loop import FilmEnv
from care_sim.evaluation.sightings import Sightings
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sensors.pictures import FULL_CONFIDENCE, MIN_PIXELS
from care_sim.sensors.surround import SURROUND_CAMERAS
from care_sim.sources.street_films import SIGHT_M, record
from care_sim.streets.street import Street, make_street
from care_sim.world.bodies import CATALOGUE
from tests.helpers.short_streets import part_of

KEYFRAMES = slice(10, 14)
LABELLED = ("car", "van", "truck", "bus", "bicycle", "pedestrian")


@pytest.fixture(scope="module", params=[1, 2])
def street(request):
    return part_of(make_street(request.param), KEYFRAMES)


@pytest.fixture(scope="module")
def film(street):
    return record(street)


def standing_street(*bodies, keyframes=1, ego=(0.0, 0.0, 0.0)):
    """A street where bodies (kind, x, y) stand; a pose may also be a list, one a keyframe."""
    poses = np.array(
        [np.broadcast_to([*place, 0.0], (keyframes, 3)) for _, *place in bodies]
    ).reshape(len(bodies), keyframes, 3)
    kinds = tuple(kind for kind, *_ in bodies)
    way = np.broadcast_to(np.array(ego), (keyframes, 3)).copy()
    return Street("hand-built", kinds, np.moveaxis(poses, 0, 1).copy(), way, (Ego(),) * keyframes)


def shot_of(*bodies, **street):
    return record(standing_street(*bodies, **street)).shots[0]


def test_a_film_shows_every_keyframe_in_order(street, film):
    assert film.name == street.name
    assert film.cameras == SURROUND_CAMERAS
    assert (film.sensor_height_m, film.keyframe_s) == (LIDAR_POSITION[2], 0.5)
    assert [shot.time_s for shot in film.shots] == [0.0, 0.5, 1.0, 1.5]
    assert len({shot.token for shot in film.shots}) == 4
    assert tuple(shot.ego for shot in film.shots) == street.motion


def test_returns_lie_in_their_cells_which_ascend(film):
    grid = AngularGrid()
    for shot in film.shots:
        cloud = shot.cloud
        assert (np.diff(cloud.cells) > 0).all()
        assert np.array_equal(grid.cells_of(cloud.points), cloud.cells)
        ranges = np.linalg.norm(cloud.points, axis=1)
        assert (ranges > 1.0).all()
        assert (ranges <= grid.range_m + 1e-9).all()


def test_returns_of_an_object_lie_in_its_box(film):
    for shot in film.shots:
        for number, box in zip(
            shot.annotations.objects.tolist(), shot.annotations.boxes, strict=True
        ):
            points = shot.cloud.points[shot.cloud.objects == number] - box[:3]
            cos, sin = np.cos(-box[6]), np.sin(-box[6])
            x, y = cos * points[:, 0] - sin * points[:, 1], sin * points[:, 0] + cos * points[:, 1]
            local = np.column_stack([x, y, points[:, 2]])
            assert (np.abs(local) <= box[3:6] / 2 + 0.05).all()


def test_only_labelled_bodies_are_objects_and_keep_number_class_and_size(street, film):
    for shot in film.shots:
        annotations = shot.annotations
        assert (np.diff(annotations.objects) > 0).all()
        for number, label, box in zip(
            annotations.objects.tolist(),
            annotations.classes.tolist(),
            annotations.boxes,
            strict=True,
        ):
            kind = CATALOGUE[street.kinds[number]]
            assert CLASSES[label] == kind.label
            assert box[3:6] == pytest.approx(kind.size)


def test_boxes_stand_where_the_street_has_them(street, film):
    for keyframe, shot in enumerate(film.shots):
        world = shot.sensor.boxes_to_world(shot.annotations.boxes)
        assert world[:, [0, 1]] == pytest.approx(
            street.poses[keyframe, shot.annotations.objects][:, :2]
        )
        assert world[:, 2] == pytest.approx(world[:, 5] / 2)


def test_whatever_is_seen_is_annotated_and_nothing_else(film):
    for shot in film.shots:
        seen = {*shot.cloud.objects.tolist(), *shot.seen.objects.tolist()} - {NO_OBJECT}
        assert seen == set(shot.annotations.objects.tolist())


def test_camera_boxes_are_of_their_objects_and_confident_by_pixels(film):
    for shot in film.shots:
        identified = shot.seen.detections
        classes = dict(
            zip(shot.annotations.objects.tolist(), shot.annotations.classes.tolist(), strict=True)
        )
        assert [
            classes[number] for number in shot.seen.objects.tolist()
        ] == identified.classes.tolist()
        assert identified.confidences.min() >= MIN_PIXELS / (MIN_PIXELS + FULL_CONFIDENCE)
        assert set(identified.cameras.tolist()) <= set(range(6))
        assert not identified.ages.any()
        assert not identified.yaw_changes.any()


def test_the_same_street_gives_the_same_film_to_the_last_bit(street, film):
    for shot, again in zip(film.shots, record(street).shots, strict=True):
        for first, second in (
            (shot.cloud.cells, again.cloud.cells),
            (shot.cloud.points, again.cloud.points),
            (shot.cloud.objects, again.cloud.objects),
            (shot.annotations.boxes, again.annotations.boxes),
            (shot.annotations.objects, again.annotations.objects),
            (shot.seen.objects, again.seen.objects),
            (shot.seen.detections.rows(), again.seen.detections.rows()),
        ):
            assert np.array_equal(first, second)


def test_a_shot_does_not_depend_on_the_keyframes_before_it(street, film):
    alone = record(part_of(street, slice(3, 4))).shots[0]
    assert np.array_equal(alone.annotations.objects, film.shots[3].annotations.objects)
    assert np.array_equal(alone.cloud.cells, film.shots[3].cloud.cells)
    assert alone.cloud.points == pytest.approx(film.shots[3].cloud.points, abs=1e-6)


def test_a_person_behind_a_house_is_not_annotated_until_it_steps_out():
    house = ("building", 20.0, 10.0)
    assert shot_of(house, ("pedestrian", 20.0, 16.0)).annotations.objects.tolist() == []
    shot = shot_of(house, ("pedestrian", 20.0, 4.0))
    assert shot.annotations.objects.tolist() == [1]
    assert CLASSES[shot.annotations.classes[0]] == "pedestrian"
    assert set(shot.cloud.objects.tolist()) == {NO_OBJECT, 1}


def test_who_stands_hidden_at_first_was_present_and_is_annotated_nowhere_until_it_shows():
    house = ("building", 20.0, 10.0)
    waiting = ("pedestrian", 20.0, 16.0)
    street = standing_street(
        house, waiting, ("car", 15.0, -5.0), ("pedestrian", 90.0, 0.0), keyframes=2
    )
    street.poses[1, 1, 1] = 4.0
    film = record(street)
    assert film.hidden.objects.tolist() == [1]
    assert CLASSES[film.hidden.classes[0]] == "pedestrian"
    assert film.hidden.boxes[0, :2] == pytest.approx((20.0 - LIDAR_POSITION[0], 16.0))
    assert [shot.annotations.objects.tolist() for shot in film.shots] == [[2], [1, 2]]
    shots = [shot.annotations for shot in film.shots]
    assert len(Sightings.of(film.name, shots, hidden=film.hidden).events) == 0
    assert len(Sightings.of(film.name, shots, hidden=film.hidden, presence="visible").events) == 1


def test_a_car_beyond_the_lidar_is_annotated_where_a_camera_shows_it():
    shot = shot_of(("car", 55.0, 0.0))
    assert shot.seen.objects.tolist() == [0]
    assert shot.annotations.objects.tolist() == [0]
    assert (shot.cloud.objects == NO_OBJECT).all()
    assert len(shot_of(("car", SIGHT_M + 3.0, 0.0)).annotations) == 0


@pytest.mark.parametrize(
    ("place", "camera"), [((15, 0), 0), ((9, 13), 1), ((9, -13), 2), ((-5, 14), 3), ((-15, 0), 5)]
)
def test_the_ring_of_cameras_sees_all_around(place, camera):
    assert camera in shot_of(("car", *place)).seen.detections.cameras.tolist()


def test_a_body_that_comes_near_later_is_where_it_then_is():
    street = standing_street(("car", 200.0, 0.0), keyframes=3)
    street.poses[1:, 0, 0] = (150.0, 30.0)
    shots = record(street).shots
    assert [len(shot.annotations) for shot in shots] == [0, 0, 1]
    assert shots[2].annotations.boxes[0, 0] == pytest.approx(30.0 - LIDAR_POSITION[0])


def test_an_empty_street_shows_its_road():
    shot = shot_of()
    assert (len(shot.annotations), len(shot.seen.objects)) == (0, 0)
    assert shot.cloud.points[:, 2] == pytest.approx(-LIDAR_POSITION[2])


def test_a_body_that_left_and_returned_is_where_it_then_is():
    street = standing_street(("car", 20.0, 0.0), keyframes=4)
    street.poses[1:, 0, 0] = (200.0, 200.0, 25.0)
    shots = record(street).shots
    nearest = [
        np.min(shot.cloud.points[shot.cloud.objects == 0, 0], initial=np.inf) for shot in shots
    ]
    assert nearest[0] == pytest.approx(
        20.0 - LIDAR_POSITION[0] - CATALOGUE["car"].size[0] / 2, abs=0.3
    )
    assert nearest[1:3] == [np.inf, np.inf]
    assert nearest[3] == pytest.approx(nearest[0] + 5.0, abs=0.3)
    for shot in shots[1:3]:
        assert shot.cloud.points[:, 2] == pytest.approx(-LIDAR_POSITION[2], abs=1e-3)


@pytest.mark.parametrize(
    ("body", "told"),
    [(0, r"the pose of car \(column 0\) is 10, nan, 0"), (None, "the pose of the ego")],
)
def test_who_gets_lost_in_a_street_is_named_with_the_time(body, told):
    street = standing_street(("car", 10.0, 3.0), ("bus", 20.0, 3.0), keyframes=3)
    table = street.ego if body is None else street.poses[:, body]
    table[2, 1] = np.nan
    with pytest.raises(InvalidInput, match=rf"street hand-built: {told}.* at 1 s; x, y and"):
        record(street)


def test_a_street_without_bodies_is_played():
    still = np.zeros((3, 3))
    empty = Street("empty", (), np.zeros((3, 0, 3)), still, (Ego(),) * 3)
    with FilmEnv(record(empty)) as env:
        env.reset(seed=0)
        for _ in range(3):
            *_, info = env.step(np.zeros(env.action_space.shape, np.float32))
        assert info["outcome"]["object_frames"] == info["outcome"]["first_sightings"] == 0
        assert env.score.event_rows() == []
        assert env.score.tally().frames == 0
