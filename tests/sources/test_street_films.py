import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import ClosedLoopConditions, FilmedReturns
from care_sim.core.frames import turned
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.core.types import CLASSES, Ego
from care_sim.envs.open_loop import FilmEnv
from care_sim.evaluation.sightings import Sightings
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sensors.surround import SURROUND_CAMERAS
from care_sim.sources import street_films
from care_sim.sources.named import source_of
from care_sim.sources.scenes import Generated, Scene
from care_sim.sources.street_films import SIGHT_M, record
from care_sim.streets.street import Street, make_street
from care_sim.world.bodies import CATALOGUE
from tests.helpers.short_streets import part_of

KEYFRAMES = slice(10, 14)


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
    assert film.kerbs == street.kerbs != ()


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


def test_whatever_is_seen_is_annotated_and_nothing_else(film):
    for shot in film.shots:
        seen = {*shot.cloud.objects.tolist(), *shot.seen.objects.tolist()} - {NO_OBJECT}
        assert seen == set(shot.annotations.objects.tolist())


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


CLUTTERED = FilmedReturns(clutter=True)


@pytest.fixture(scope="module")
def cluttered():
    return part_of(make_street(5, clutter=True), slice(10, 13))


def test_both_engines_agree_on_a_cluttered_street(cluttered, monkeypatch):
    """Bullet crashes on a body of more than 16 parts, so bodies are split before it meets them."""
    fast = record(cluttered, returns=CLUTTERED)
    monkeypatch.setattr(street_films, "_CLUTTER_ENGINE", "bullet")
    bullet = record(cluttered, returns=CLUTTERED)
    for one, other in zip(fast.shots, bullet.shots, strict=True):
        both = np.intersect1d(one.cloud.cells, other.cloud.cells, return_indices=True)
        cells, mine, theirs = both
        assert len(cells) > 0.999 * max(len(one.cloud), len(other.cloud))
        apart = np.linalg.norm(one.cloud.points[mine] - other.cloud.points[theirs], axis=1)
        # Bullet ends a few millimetres off where a ray grazes an edge.
        assert (apart < 0.002).mean() > 0.995
        assert (apart < 0.02).mean() > 0.999
        assert (one.cloud.objects[mine] == other.cloud.objects[theirs]).mean() > 0.999
        assert np.array_equal(one.annotations.objects, other.annotations.objects)


def test_clutter_hides_and_slopes_and_the_film_is_the_same_again(cluttered):
    film, again = (record(cluttered, returns=CLUTTERED) for _ in range(2))
    clean = record(part_of(make_street(5), slice(10, 13)))
    for one, other, before in zip(film.shots, again.shots, clean.shots, strict=True):
        assert np.array_equal(one.cloud.points, other.cloud.points)
        assert (before.sensor.pitch, before.sensor.roll) == (0.0, 0.0)
        assert (one.sensor.pitch, one.sensor.roll) != (0.0, 0.0)
        # The road lies where the frame that leans says, and nothing is met below a pavement.
        world = one.sensor.vectors_to_world(one.cloud.points) + one.sensor.origin
        assert world[:, 2].min() > -0.05
        assert (np.abs(world[:, 2]) < 0.02).mean() > 0.1
        on_pavements = 0
        for kind, (x, y, yaw) in cluttered.clutter:
            if kind.name == "pavement":
                inner = np.array(kind.size[:2]) / 2 - 0.05
                on = (np.abs(turned(world[:, :2] - (x, y), -yaw)) < inner).all(axis=1)
                assert (world[on, 2] > kind.size[2] - 0.03).all()
                on_pavements += on.sum()
        assert on_pavements > 300
        lost = 1 - len(one.cloud) / len(before.cloud)
        assert 0.03 < lost < 0.4


def test_rays_past_a_body_return_what_stands_behind_it_and_the_body_stays(cluttered):
    shot = record(cluttered, returns=CLUTTERED).shots[-1]
    cloud, there = shot.cloud, shot.annotations
    ranges = np.linalg.norm(cloud.points, axis=1)
    car = np.argmax([(cloud.objects == one).sum() for one in there.objects])
    (own,) = np.nonzero(cloud.objects == there.objects[car])
    # Between the returns of a row that lie on the body others lie behind it, and are of nobody.
    low, high = cloud.cells[own].min() // 512, cloud.cells[own].max() // 512
    behind = []
    for row in range(low, high + 1):
        cells = cloud.cells[own[cloud.cells[own] // 512 == row]]
        if len(cells) > 2 and np.ptp(cells) < 256:
            among = (cloud.cells > cells[0]) & (cloud.cells < cells[-1])
            behind += [*np.flatnonzero(among & (ranges > ranges[own].max() + 0.5))]
    assert len(behind) > 0.1 * len(own)
    assert (cloud.objects[behind] == NO_OBJECT).all()


def test_a_rolling_beam_and_clutter_go_together(cluttered):
    settings = FilmedReturns(clutter=True, lidar_stated_range_m=100.0, lidar_sweep_s=0.1)
    cloud = record(part_of(cluttered, slice(2)), returns=settings).shots[0].cloud
    assert cloud.intensities is not None
    assert len(cloud) > 5000


def test_clutter_is_refused_where_no_street_is_generated():
    with pytest.raises(InvalidInput, match="clutter is of films of generated streets"):
        ClosedLoopConditions(clutter=True)
    with pytest.raises(InvalidInput, match="clutter cannot be changed on recordings"):
        source_of("boreas").check_returns(CLUTTERED)
    with pytest.raises(InvalidInput, match="clutter cannot be changed of the film"):
        FilmEnv(record(standing_street(("car", 20.0, 5.0), keyframes=3)), clutter=True)

    class Bare(Generated):
        def seeds(self):
            return [0]

        def street(self, seed):
            return make_street(seed)

    with pytest.raises(InvalidInput, match="source Bare has no `cluttered`"):
        Bare().film(Scene("bare", 0), CLUTTERED)
