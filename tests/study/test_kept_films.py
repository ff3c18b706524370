"""Kept films are the films that were made, to the last bit; what differs is made again."""

from unittest import mock

import numpy as np
import pytest

from care_sim.base.files import cache_folder
from care_sim.core.conditions import RAYS, FilmedReturns
from care_sim.sources import scenes
from care_sim.sources.scenes import Scene, Streets
from care_sim.streets.street import make_street, street_name
from care_sim.study import kept_films
from care_sim.study.kept_films import kept_film
from tests.helpers.short_streets import part_of

FIRST = Streets().scenes()[0]


@pytest.fixture(scope="module")
def films():
    """Films of three keyframes by scene, sensor and returns."""
    return {}


@pytest.fixture
def made(films, tmp_path, monkeypatch):
    """The scenes whose films were made and not read."""
    asked = []

    def make(source, scene, returns=RAYS):
        asked.append(scene.name)
        key = source, scene, returns
        if key not in films:
            films[key] = record(source, scene, returns)
        return films[key]

    def short(seed, clutter=False):
        return part_of(make_street(seed, clutter), slice(3))

    record = Streets.film
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(scenes, "make_street", short)
    monkeypatch.setattr(Streets, "film", make)
    return asked


@pytest.mark.parametrize("sensor", ["nuscenes", "roof-and-corners"])
def test_a_kept_film_is_the_one_that_was_made(made, sensor):
    source = Streets(sensor=sensor)
    first, again = (kept_film(source, FIRST, RAYS) for _ in range(2))
    assert made == [FIRST.name]
    assert first is not again
    for mine, kept in zip(first.shots, again.shots, strict=True):
        assert np.array_equal(mine.cloud.points, kept.cloud.points)
        assert np.array_equal(mine.cloud.objects, kept.cloud.objects)
        assert np.array_equal(mine.annotations.boxes, kept.annotations.boxes)
        assert np.array_equal(mine.seen.detections.rows(), kept.seen.detections.rows())
        assert (mine.sensor, mine.ego) == (kept.sensor, kept.ego)
    assert (first.name, first.grid, first.cameras) == (again.name, again.grid, again.cameras)


@pytest.mark.parametrize("change", ["code", "damage", "cut"])
def test_a_film_of_other_code_or_a_damaged_one_is_made_again(made, change, monkeypatch):
    kept_film(Streets(), FIRST, RAYS)
    (file,) = cache_folder("films").iterdir()
    content = bytearray(file.read_bytes())
    if change == "code":
        monkeypatch.setattr(kept_films, "_maker", lambda: b"other code")
    content[-9] ^= change == "damage"
    file.write_bytes(content[: -9 if change == "cut" else None])
    for _ in range(2):
        kept_film(Streets(), FIRST, RAYS)
    assert made == [FIRST.name] * 2
    assert [*cache_folder("films").iterdir()] == [file]


def test_sensors_have_files_of_their_own(made):
    for sensor in ("nuscenes", "roof-and-corners") * 2:
        film = kept_film(Streets(sensor=sensor), FIRST, RAYS)
        assert film.grid == scenes.sensor_setup(sensor).grid
    assert len(made) == 2


class Own(Streets):
    """A source of somebody else."""


@pytest.mark.parametrize(
    ("source", "scene", "returns"),
    [
        (Streets(), Scene(street_name(12_000), 12_000), RAYS),
        (Streets(), Scene("another name", 0), RAYS),
        (Streets(), FIRST, FilmedReturns(lidar_stated_range_m=100.0)),
        (Own(), FIRST, RAYS),
    ],
)
def test_other_films_are_not_kept(made, source, scene, returns):
    for _ in range(2):
        kept_film(source, scene, returns)
    assert len(made) == 2
    assert not cache_folder("films").exists()


def test_without_room_a_film_is_made_every_time(made, tmp_path):
    (tmp_path / "care-sim").write_text("a file where the folder would be")
    for _ in range(2):
        assert len(kept_film(Streets(), FIRST, RAYS).shots) == 3
    assert len(made) == 2


def test_a_cloud_whose_points_are_not_of_its_rays_is_not_kept(made):
    with mock.patch.object(kept_films, "_LAST_BITS", -1):
        kept_film(Streets(), FIRST, RAYS)
    assert not cache_folder("films").exists()
