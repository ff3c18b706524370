"""The drive that comes with the package."""

import gymnasium
import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.evaluation.sightings import Sightings
from care_sim.sources.boreas import BOREAS_FILE, Boreas
from care_sim.sources.named import source_of
from tests.helpers.boreas_file import columns

MOST_BYTES = 400_000


@pytest.fixture(scope="module")
def film():
    source = source_of("boreas")
    return source.film(source.scenes()[0])


def test_the_file_is_made_from_the_dataset(recorded):
    made = columns(recorded / "boreas" / "boreas-objects-v1")
    with np.load(Boreas.shipped / BOREAS_FILE) as held:
        assert set(held) == set(made)
        for name, values in made.items():
            np.testing.assert_array_equal(held[name], values)


def test_it_is_small_and_says_whose_it_is():
    assert (Boreas.shipped / BOREAS_FILE).stat().st_size < MOST_BYTES
    told = (Boreas.shipped / "boreas.md").read_text()
    for part in ("Burnett", "University of Toronto", "CC BY 4.0", "licenses/by/4.0", "Changes"):
        assert part in told


def tracks(film):
    seen = {}
    for shot in film.shots:
        world = shot.sensor.boxes_to_world(shot.annotations.boxes)
        for number, box in zip(shot.annotations.objects.tolist(), world, strict=True):
            seen.setdefault(number, []).append(np.append(box, shot.sensor.origin))
    return [np.array(places) for places in seen.values()]


def test_standing_cars_stay_and_others_drive_where_they_point(film):
    still, astray = [], []
    for places in tracks(film):
        moved = places[-1, :2] - places[0, :2]
        driven = np.linalg.norm(places[-1, 7:9] - places[0, 7:9])
        if driven > 10 and np.linalg.norm(moved) < 2.5:
            still.append([np.linalg.norm(moved), np.ptp(places[:, 2])])
        if np.linalg.norm(moved) > 20:
            along = np.arctan2(moved[1], moved[0]) - np.median(places[:, 6])
            astray.append(np.degrees(np.abs(np.angle(np.exp(1j * along)))))
    assert len(still) > 40
    assert len(astray) > 10
    assert np.median(still, axis=0) == pytest.approx([0.5, 0.3], abs=0.2)
    assert np.quantile(still, 0.9, axis=0) == pytest.approx([1.3, 0.6], abs=0.2)
    assert np.median(astray) < 3.0


def test_boxes_stand_on_the_road_and_the_car_drives_ahead(film):
    bottoms = [
        box[2] - box[5] / 2 + film.sensor_height_m
        for shot in film.shots
        for box in shot.annotations.boxes
        if np.hypot(*box[:2]) < 15
    ]
    assert np.median(bottoms) == pytest.approx(0, abs=0.1)
    assert film.shots[10].ego.speed == pytest.approx(15.5, abs=0.5)
    way = film.shots[20].sensor.origin - film.shots[10].sensor.origin
    assert np.arctan2(way[1], way[0]) == pytest.approx(film.shots[15].sensor.yaw, abs=0.01)


def test_its_newcomers(film):
    assert (len(film.shots), film.keyframe_s) == (48, pytest.approx(0.415, abs=0.002))
    sightings = Sightings.of("boreas", [shot.annotations for shot in film.shots])
    assert len(sightings.events) == 98


def test_it_needs_no_folder():
    with gymnasium.make("CARE-Replay-v0", source="boreas") as env:
        observation, _ = env.reset(seed=0)
        assert env.observation_space.contains(observation)
    with gymnasium.make("CARE-Replay-v0", source="boreas", sensor="os1-64") as env:
        assert env.action_space.shape == (64, 1024)
    with pytest.raises(InvalidInput, match=r"source must be .*sweeps:FOLDER, boreas, or"):
        source_of("boreas:somewhere")
    with pytest.raises(InvalidInput, match="split has no meaning for boreas"):
        source_of("boreas", split="val")
