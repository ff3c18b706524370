"""A recorded sequence in fog (RADIATE), turned into a folder of sweeps by the example."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from care_sim.evaluation.sightings import Sightings
from care_sim.sources.installed import recordings
from care_sim.sources.sweeps.logs import log_of_folder
from tests.helpers.examples import EXAMPLES, loaded
from tests.helpers.places import ROOT

FOGGY = ROOT / ".." / "shared" / "data" / "radiate" / "tiny_foggy"
pytestmark = pytest.mark.skipif(not FOGGY.is_dir(), reason="RADIATE is not at hand")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("radiate") / "tiny_foggy"
    loaded(EXAMPLES / "radiate_sweeps.py").convert(FOGGY, out)
    return out


def misfit(folder, yaw_deg):
    """Metres in the world between what two sweeps half a second apart show above the road, median
    of their points.
    """
    log = log_of_folder(folder)
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    apart = []
    for first in (10, 25, 40):
        world = []
        for number in (first, first + 5):
            points = log.points_of(number)
            ranges = np.hypot(*points[:, :2].T)
            x, y, z = points[(ranges > 6) & (ranges < 40) & (points[:, 2] > -1.2)].T
            (car,) = log.cars(log.times_s[[number]])
            own = np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
            world.append(car.origin + car.vectors_to_world(own))
        apart.append(np.median(cKDTree(world[0]).query(world[1])[0]))
    return float(np.mean(apart))


def test_what_stands_stays_in_the_world_with_the_axes_of_the_car(folder):
    right = misfit(folder, 0)
    assert right < 0.3
    assert min(misfit(folder, yaw) for yaw in (-90, 90, 180)) > 4 * right


def test_the_film_has_the_speed_of_the_gps_and_a_flat_road_where_the_set_up_has_it(folder):
    film = recordings(f"sweeps:{folder}").film("tiny_foggy")
    assert len(film.shots) == 12
    speeds = [shot.ego.speed for shot in film.shots[1:]]
    assert speeds[0] == pytest.approx(12.1, abs=0.3)
    assert speeds[-1] == pytest.approx(9.5, abs=0.3)
    points = np.concatenate([shot.cloud.points for shot in film.shots])
    ranges = np.hypot(*points[:, :2].T)
    road = points[(ranges > 3) & (ranges < 12) & (np.abs(points[:, 2] + 2.03) < 0.15)]
    plane = np.linalg.lstsq(np.column_stack([road[:, :2], np.ones(len(road))]), road[:, 2])[0]
    assert np.degrees(np.hypot(*plane[:2])) < 1.5
    sightings = Sightings.of(film.name, [shot.annotations for shot in film.shots])
    assert 8 <= len(sightings.events) <= 20
