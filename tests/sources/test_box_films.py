"""Films of recordings are checked where they are made."""

from dataclasses import replace

import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Frame
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.sources.box_films import motions
from care_sim.sources.film_checks import check_film
from care_sim.sources.named import source_of
from care_sim.study.scene_play import film_hash
from tests.helpers.av2_log import CAR_AHEAD, box, parked

TIMES = np.array([0.0, 0.5, 1.0, 1.6, 2.0, 2.5])


def on_a_line(way, yaw=0.4):
    return [Frame(w * np.cos(yaw), w * np.sin(yaw), 0.0, yaw) for w in way]


def test_a_steady_acceleration_is_told_without_lag():
    """5 m/s gaining 2 m/s every second, at uneven times."""
    egos = motions(TIMES, on_a_line(5 * TIMES + TIMES**2))
    for time, ego in [*zip(TIMES, egos, strict=True)][2:]:
        assert ego.speed == pytest.approx(5 + 2 * time)
        assert ego.acceleration == pytest.approx(2.0)
        assert ego.yaw_rate == pytest.approx(0.0, abs=1e-9)


def test_a_turn_through_the_seam_has_its_rate():
    poses = [Frame(0.0, 0.0, 0.0, (3.0 + 0.2 * t + np.pi) % (2 * np.pi) - np.pi) for t in TIMES]
    assert [ego.yaw_rate for ego in motions(TIMES, poses)[1:]] == pytest.approx([0.2] * 5)


@pytest.mark.parametrize("turn", [1, 2, 4])
def test_nothing_of_the_future_is_in_it(turn):
    """A car that brakes or turns later moves until then like one that does not."""
    way = 5 * TIMES
    turned = on_a_line(way)
    turned[turn:] = on_a_line(way[turn:] / 2, yaw=1.5)
    before = motions(TIMES, on_a_line(way))
    assert motions(TIMES, turned)[:turn] == before[:turn]
    assert motions(TIMES, turned)[turn] != before[turn]


def test_after_a_keyframe_of_braking_all_of_it_is_told():
    """10 m/s, from 1 s on losing 3 m/s every second, at 10 Hz."""
    times = np.arange(21) / 10
    braking = np.clip(times - 1.0, 0.0, None)
    ego = motions(times, on_a_line(10 * times - 1.5 * braking**2))[15]
    assert (ego.speed, ego.acceleration) == (pytest.approx(8.5), pytest.approx(-3.0))


OBJECTS = (
    ("van", "truck", 118, 54),
    ("a", "car", 122, 46),
    ("b", "pedestrian", 130, 55),
    ("house", None, 126, 60),
)


def told(frame="world", count=6, **changes):
    """Arguments of `film_of_boxes`: a car at 8 m/s past standing bodies."""
    ego = [[100 + 4.0 * k, 50.0, 10.0, 0.0] for k in range(count)]
    boxes = [
        [
            {"id": name, "class": label, "size": [4.0, 2.0, 1.6]}
            | {"pose": [x, y, 10.8, 0.3] if frame == "world" else [x - place, y - 50, 0.8, 0.3]}
            for name, label, x, y in OBJECTS
        ]
        for place, *_ in ego
    ]
    return {"name": "mine", "times_s": [0.5 * k for k in range(count)], "ego_poses": ego} | {
        "boxes": boxes,
        **changes,
    }


@pytest.fixture(scope="module")
def film():
    return care_sim.film_of_boxes(**told())


def changed(film, shot=2, **values):
    """The film, with other annotations in one of its shots."""
    annotations = replace(film.shots[shot].annotations, **values)
    shots = [*film.shots]
    shots[shot] = replace(shots[shot], annotations=annotations)
    return replace(film, shots=tuple(shots))


def with_box(film, column, value):
    boxes = film.shots[2].annotations.boxes.copy()
    boxes[1, column] = value
    return changed(film, boxes=boxes)


def with_car(film, **values):
    shots = [*film.shots]
    shots[2] = replace(shots[2], sensor=replace(shots[2].sensor, **values))
    return replace(film, shots=tuple(shots))


WRONG = {
    "no film": (lambda film: None, "film must return a Film, got NoneType"),
    "two keyframes": (
        lambda film: replace(film, shots=film.shots[:2]),
        "mine: a film needs at least 3 keyframes, this one has 2",
    ),
    "times": (lambda film: replace(film, shots=film.shots[::-1]), "mine: times must ascend"),
    "no size": (lambda film: with_box(film, 4, 0.0), "mine at 1 s: object 1 has a size outside"),
    "inf": (lambda film: with_box(film, 6, np.inf), "object 1 has a place, size or yaw that is"),
    "degrees": (lambda film: with_box(film, 6, 90.0), "object 1 has a yaw beyond a full turn"),
    "car in degrees": (
        lambda film: with_car(film, yaw=90.0),
        "the car is turned by 90, must be radians",
    ),
    "car nowhere": (lambda film: with_car(film, x=np.nan), "mine at 1 s: the pose or the motion"),
    "twice": (
        lambda film: changed(film, objects=np.zeros(3, np.int64)),
        "mine at 1 s: an object is annotated twice",
    ),
    "class": (
        lambda film: changed(film, classes=np.full(3, 9)),
        "mine at 1 s: classes must be numbers from 0 to 4",
    ),
    "uneven": (lambda film: changed(film, classes=np.zeros(2, np.int64)), "equally many"),
    "flat": (lambda film: changed(film, boxes=np.zeros((3, 6))), r"boxes must be \(n, 7\)"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_no_drive_holds_is_named(film, name):
    change, message = WRONG[name]
    check_film(film)
    with pytest.raises(InvalidInput, match=message):
        check_film(change(film))


def test_recordings_annotate_something(tmp_path):
    parked(tmp_path / "short", CAR_AHEAD)
    parked(tmp_path / "empty", box("SIGN", (15.0, 0.0, 0.42)), sweeps=11)
    source = source_of(f"argoverse2:{tmp_path}")
    empty, short = source.scenes()
    with pytest.raises(InvalidInput, match=r"empty: no car, no truck, .* in any of its keyframes"):
        source.film(empty)
    with pytest.raises(InvalidInput, match="short: a film needs at least 3 keyframes"):
        source.film(short)


def test_boxes_in_another_frame_are_told_in_a_line(film, capsys):
    as_told = [
        (shot.sensor.boxes_to_world(shot.annotations.boxes), shot.annotations)
        for shot in film.shots
    ]
    check_film(film)
    assert capsys.readouterr().err == ""
    shots = [
        replace(shot, annotations=replace(shot.annotations, boxes=world))
        for shot, (world, _) in zip(film.shots, as_told, strict=True)
    ]
    check_film(replace(film, shots=tuple(shots)))
    assert "care-sim: mine: its boxes move along with the car" in capsys.readouterr().err
    care_sim.film_of_boxes(**told("car"))
    assert "care-sim: mine: its boxes move against the car" in capsys.readouterr().err


def test_a_film_of_boxes_holds_them_as_they_were_told(film):
    first, second, *_ = film.shots
    assert (film.name, film.keyframe_s, film.place) == ("mine", 0.5, LIDAR_POSITION[:2])
    assert [shot.time_s for shot in film.shots] == [0.5 * k for k in range(6)]
    assert first.ego.speed == 0, "nothing is known of its past"
    assert second.ego.speed == pytest.approx(8.0)
    assert second.annotations.objects.tolist() == [0, 1, 2]
    world = second.sensor.boxes_to_world(second.annotations.boxes)
    # The world of a film begins at the first place of the car.
    assert world[0] == pytest.approx([18.0, 4.0, 0.8, 4.0, 2.0, 1.6, 0.3])
    assert {*second.cloud.objects.tolist()} >= {0, 1, 2}
    assert {*second.seen.objects.tolist()} >= {0, 1}


def test_who_is_hidden_is_not_annotated():
    """A house stands before the person at first; the car drives past it."""
    boxes = told()["boxes"]
    for keyframe in boxes:
        keyframe[:] = [
            {"id": 1, "class": None, "size": [2, 8, 6], "pose": [110, 54, 13, 0]},
            {"id": 2, "class": "pedestrian", "size": [0.6, 0.6, 1.8], "pose": [118, 55, 10.9, 0]},
        ]
    film = care_sim.film_of_boxes(**told(boxes=boxes))
    assert [len(shot.annotations) for shot in film.shots][::3] == [0, 1]
    assert len(film.hidden) == 1


def test_a_tilted_car_sees_what_stands_in_its_own_axes():
    level, tilted = told(), told()
    tilted["ego_poses"] = [[*pose, 0.03, -0.05] for pose in level["ego_poses"]]
    straight, film = (care_sim.film_of_boxes(**given) for given in (level, tilted))
    for one, other in zip(straight.shots, film.shots, strict=True):
        car = Frame(*tilted["ego_poses"][0][:3], 0.0, 0.03, -0.05)
        turn = car.rotation.inv()
        place = one.sensor.boxes_to_world(one.annotations.boxes)[:, :3] - other.sensor.origin
        assert other.annotations.boxes[:, :3] == pytest.approx(turn.apply(place), abs=1e-9)


def one(**changes):
    boxes = told()["boxes"]
    boxes[1][0] |= changes
    return {"boxes": boxes}


TOLD_WRONG = {
    "degrees": (one(pose=[118, 54, 10.8, 90]), "mine at 0.5 s: object 'van': pose: yaw must be ra"),
    "size": (one(size=[4, 2, 0]), r"object 'van': size must lie in \[0.01, 200\]"),
    "text": (one(pose="here"), "object 'van': pose must be 4 numbers, got 'here'"),
    "class": (one(**{"class": "tram"}), "unknown class of mine at 0.5 s: object 'van' 'tram'; k"),
    "id": (one(id=[1]), "id must be a text or a whole number"),
    "far": (one(pose=[1e5, 54, 10.8, 0]), "object 'van': pose lies 99896.4 m from the car"),
    "keys": ({"boxes": [[{"id": 1}]] * 6}, "a box must have id, class, size and pose, got"),
    "no list": ({"boxes": [5] * 6}, "mine at 0 s: boxes must be a list, got 5"),
    "uneven": ({"times_s": [0, 1]}, "must hold as many keyframes, at least 3, got 2, 6 and 6"),
    "times": ({"times_s": [0, 1, 2, 3, 4, 4]}, "mine: times_s must ascend"),
    "ego": ({"ego_poses": [[0, 0, 0]] * 6}, "mine: ego_poses must be n x 4 numbers"),
    "ego pitch": (
        {"ego_poses": [[100, 50, 10, 0, 0, 9]] * 6},
        "mine: ego_poses: pitch must be radians",
    ),
    "nothing": ({"boxes": [[]] * 6}, "mine: no car, no truck"),
}


@pytest.mark.parametrize("name", TOLD_WRONG)
def test_what_is_told_wrong_is_named(name):
    changes, message = TOLD_WRONG[name]
    with pytest.raises(InvalidInput, match=message):
        care_sim.film_of_boxes(**told(**changes))


@pytest.mark.parametrize("step", [0.1, 0.5, 0.0625])
def test_times_since_1970_give_the_film_of_times_from_the_start(step):
    """A float holds them to 0.2 us, and the film has whole microseconds."""
    stamps = [1_700_000_000.3 + step * k for k in range(6)]
    stamped = care_sim.film_of_boxes(**told(times_s=stamps))
    plain = care_sim.film_of_boxes(**told(times_s=[round(step * k, 6) for k in range(6)]))
    assert stamped.keyframe_s == plain.keyframe_s
    assert film_hash(stamped) == film_hash(plain)


def test_an_id_of_numpy_is_a_number():
    given = told()
    numbers = [[one | {"id": n} for n, one in enumerate(boxes)] for boxes in given["boxes"]]
    numpy = [[one | {"id": np.int32(one["id"])} for one in boxes] for boxes in numbers]
    ours, theirs = (
        care_sim.film_of_boxes(**given | {"boxes": boxes}) for boxes in (numbers, numpy)
    )
    assert film_hash(ours) == film_hash(theirs)


@pytest.mark.parametrize("unit", [1e3, 1e9])
def test_other_units_since_1970_are_refused(unit):
    times = [unit * (1.7e9 + 0.5 * k) for k in range(6)]
    with pytest.raises(
        InvalidInput, match=r"mine: times_s \(seconds\) must lie in \[-1e\+08, 4\.6.*e\+09\]"
    ):
        care_sim.film_of_boxes(**told(times_s=times))
