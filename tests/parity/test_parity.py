"""The engine `fast` against Bullet: what differs is found, and named for what it is."""

import json
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.scenarios import SCENARIOS
from care_sim.sensors.engines import ENGINES
from care_sim.study.episode_config import EpisodeConfig
from care_sim.world.bodies import CATALOGUE
from tests.parity import episodes as parity_episodes
from tests.parity.__main__ import RANDOM, agree, main, unexplained
from tests.parity.engines import Engines, decided_by_a_micrometre
from tests.parity.episodes import OutcomeCounts, PictureCounts, compare_episode
from tests.parity.rays import (
    GRAZING,
    SAME,
    TOLERANCE,
    UNEXPLAINED,
    RayCounts,
    compare,
    ray_groups,
)

GRID = AngularGrid(columns=180, rows=24)
LEVEL = AngularGrid(columns=4, rows=3, top=0.5, bottom=-0.5)
"""Cell 6 fires level, to the left of the sensor's front by 45 degrees."""
AHEAD = -np.pi / 4


class Askew:
    """A real engine that believes its sensor to be a centimetre ahead."""

    def __init__(self, engine):
        self.engine = engine

    def cast(self, sensor, cells):
        return self.engine.cast(replace(sensor, x=sensor.x + 0.01), cells)


@pytest.fixture
def street(bullet):
    """A bus ahead, and the three engines over it."""
    bullet.add(CATALOGUE["bus"], Frame(20.0, 0.0, 0.0, 0.0))
    engines = Engines.of(bullet, GRID)
    with closing(engines.exact):
        yield engines


SENSOR, CELLS = Frame(0.0, 0.0, 1.84, 0.0), np.arange(GRID.size)


def test_engines_that_agree_are_told_the_same(street):
    compared = compare(street, SENSOR, CELLS)
    assert np.isin(1, compared.fast[1])
    assert set(compared.on_exact.tolist()) == {SAME}


def test_a_centimetre_is_seen_and_not_excused(street):
    compared = compare(street._replace(fast=Askew(street.fast)), SENSOR, CELLS)
    on_bus = compared.fast[1] == 1
    assert np.all(compared.on_exact[on_bus] == UNEXPLAINED)
    assert np.all(compared.on_bullet[on_bus] == UNEXPLAINED)


def test_what_bullet_alone_answers_otherwise_is_its_tolerance(street):
    compared = compare(street._replace(bullet=Askew(street.bullet)), SENSOR, CELLS)
    assert np.all(compared.on_bullet[compared.bullet[1] == 1] == TOLERANCE)


@pytest.mark.parametrize(("above", "grazes"), [(0.5e-6, True), (2e-6, False)])
def test_a_ray_grazes_within_a_micrometre_of_an_edge(bullet, above, grazes):
    bus = bullet.add(CATALOGUE["bus"], (20.0, 0.0, 0.0))
    engine, sensor = ENGINES["fast"](bullet, LEVEL), Frame(0.0, 0.0, 3.47 + above, AHEAD)
    assert engine.cast(sensor, np.array([6]))[1].item() != bus
    assert (
        decided_by_a_micrometre(engine, sensor, 6, (np.array([20 - 11.19 / 2]), np.array([bus])))
        == grazes
    )


def test_rays_count_where_they_end(street):
    compared, tally = compare(street, SENSOR, CELLS), RayCounts()
    frames = [Frame(20.0, 0.0, 0.0, 0.0)]
    tally.add(compared, ray_groups([CATALOGUE["bus"]], frames), {"scene": 3})
    counts = tally.figures()["references"]["Bullet in millimetres"]
    assert (
        counts["boxes, upright"]["rays"]
        == counts["boxes, upright"]["same"]
        == np.sum(compared.fast[1] == 1)
    )
    assert sum(count["rays"] for count in counts.values()) == GRID.size
    assert tally.listed == []


def test_a_difference_is_listed_with_its_scene(street):
    tally = RayCounts()
    askew = compare(street._replace(fast=Askew(street.fast)), SENSOR, np.array([6 * 180 + 90]))
    tally.add(askew, ray_groups([CATALOGUE["bus"]], [Frame(20.0, 0.0, 0.0, 0.0)]), {"scene": 3})
    (line,) = tally.listed
    assert (line["scene"], line["ray"], line["meets"], line["on_exact"]) == (
        3,
        0,
        "boxes, upright",
        "unexplained",
    )
    assert line["exact"]["m"] - line["fast"]["m"] == pytest.approx(0.01, abs=1e-3)
    assert unexplained({"scans": {"one": tally.figures()}}) == 1


def test_every_keyframe_of_an_episode_is_scanned_in_full():
    tally, pictures = RayCounts(), PictureCounts()
    short = (("duration_s", 0.2),)
    config = EpisodeConfig("dense", "care", 0.1, 0, scenario_parameters=short)
    compare_episode(config, tally, pictures)
    assert tally.scans == pictures.pictures == 3
    assert pictures.boxes > 10
    assert pictures.widest_px <= 1
    on_bullet, on_exact = tally.verdicts.sum(axis=1)
    assert on_exact.tolist() == [3 * 16384, 0, 0, 0, 0]
    assert on_bullet[UNEXPLAINED] == 0
    assert on_bullet[[GRAZING, TOLERANCE]].sum() < 1e-3 * 3 * 16384


def test_the_counts_are_printed_and_written(tmp_path, capsys):
    out = tmp_path / "new" / "parity.json"
    assert main(["--scenes", "20", "--episodes", "0", "--out", str(out)]) == 0
    report = json.loads(out.read_text())
    assert report["config"] == {"scenes": 20, "episodes": 0, "seed": 0}
    assert report["scans"][RANDOM]["scans"] == 20
    assert f"{RANDOM}: 20 scans" in capsys.readouterr().out
    names = {path.name for path in out.parent.iterdir()}
    assert names == {"parity.json", "parity.png", "parity.svg"}


@pytest.mark.slow
def test_keyframes_are_counted_as_published(published):
    known = json.loads((published / "parity.json").read_text())
    rays, pictures = parity_episodes.keyframes("dense", 5, lambda done: None)
    assert rays.figures() == known["scans"]["dense"]
    assert vars(pictures) == known["pictures"]["dense"]


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_an_episode_goes_the_same_under_both_engines(scenario):
    faults = {"camera_latency": 1, "camera_rotation_sigma_deg": 1.0, "lidar_dropout": 0.1}
    short = (("duration_s", 2.0),)
    outcomes = OutcomeCounts()
    outcomes.compare(EpisodeConfig(scenario, "care", 0.05, 7, scenario_parameters=short, **faults))
    assert (outcomes.keyframes, outcomes.other_keyframes, outcomes.other_outcomes) == (20, [], [])


def test_an_episode_that_goes_otherwise_is_named(monkeypatch):
    monkeypatch.setattr(parity_episodes, "ENGINES_PLAYED", ("fast", "nearsighted"))
    monkeypatch.setitem(
        ENGINES, "nearsighted", lambda world, grid: Nearsighted(ENGINES["bullet"](world, grid))
    )
    config, outcomes = EpisodeConfig("dense", "care", 0.1, 0), OutcomeCounts()
    outcomes.compare(config)
    label = config.changed(engine="fast").label
    assert outcomes.other_outcomes == outcomes.other_keyframes == [label]
    assert outcomes.other_than_exact == []


def test_a_ray_that_bullet_alone_widens_is_decided_in_millimetres():
    """The third ray that meets the person at keyframe 39 passes her head by less than Bullet's
    tolerance.
    """
    outcomes = OutcomeCounts()
    outcomes.compare(EpisodeConfig("dense", "all-camera", 0.03, 25))
    assert len(outcomes.other_outcomes) == 1
    assert outcomes.other_than_exact == []


class Nearsighted:
    """A real engine whose rays end after 5 m."""

    def __init__(self, engine):
        self.engine, self.body_ids = engine, engine.body_ids
        self.visible_boxes = engine.visible_boxes

    def cast(self, sensor, cells):
        ranges, ids = self.engine.cast(sensor, cells)
        return np.where(ranges < 5, ranges, np.inf), np.where(ranges < 5, ids, -1)


def report_of(rays=0, box_px=1.0, outcomes=()):
    counts = {"references": {"Bullet in millimetres": {"boxes, upright": {"unexplained": rays}}}}
    ended = {"other_outcomes": list(outcomes), "other_keyframes": ["a"], "other_than_exact": []}
    return {
        "scans": {"one": counts},
        "pictures": {"dense": {"widest_px": box_px}},
        "outcomes": ended,
    }


def test_engines_agree_when_nothing_is_left_to_explain():
    assert agree(report_of())
    assert agree({**report_of(), "pictures": {}})
    for wrong in ({"rays": 1}, {"box_px": 2.0}, {"outcomes": ["a"]}):
        assert not agree(report_of(**wrong))
