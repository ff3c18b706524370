import numpy as np
import pytest

from care_sim.core.frames import Frame
from care_sim.sensors.engines import ENGINES
from care_sim.sensors.signal import brightness
from care_sim.world.bodies import CATALOGUE, REFLECTANCES, BodyKind, Part
from care_sim.world.bullet import NO_BODY, pybullet

SENSOR = Frame(0.0, 0.0, 1.84, 0.0)
EYE = SENSOR.origin


def bright(world, ray, eye=EYE):
    """Reflectance times cosine where one ray ends."""
    ray = np.array([ray], float) / np.linalg.norm(ray)
    ranges, bodies = world.cast(np.array(eye), ray, 50.0)
    return brightness(world.primitives, np.array(eye), ray, ranges, bodies).item()


def one_part(shape, size, centre=(0.0, 0.0, 1.5), material="timber"):
    return BodyKind("thing", None, size, (Part(shape, size, centre, (0.5,) * 3, material),))


def test_the_road_is_of_asphalt_and_met_at_its_slope(bullet):
    """Down at 45 degrees the cosine is sqrt(1/2); straight down it is 1."""
    assert bright(bullet, (1, 0, -1)) == pytest.approx(0.17 * np.sqrt(0.5))
    assert bright(bullet, (0, 0, -1)) == pytest.approx(0.17)


def test_nothing_is_black(bullet):
    assert bright(bullet, (0, 0, 1)) == 0.0


@pytest.mark.parametrize("yaw", [0.0, 0.4, -1.0])
def test_a_wall_is_met_at_the_angle_by_which_it_is_turned(bullet, yaw):
    bullet.add(one_part("box", (0.2, 8.0, 3.0)), (10.0, 0.0, yaw))
    assert bright(bullet, (1, 0, 0)) == pytest.approx(0.25 * np.cos(yaw))


def test_a_ball_is_met_obliquely_towards_its_rim(bullet):
    """A ray that passes the centre by b meets a ball of radius R where the cosine is
    sqrt(1 - (b / R)^2).
    """
    bullet.add(one_part("sphere", (3.0, 3.0, 3.0)), (10.0, 0.0, 0.0))
    for passed in (0.0, 0.6, 1.2):
        assert bright(bullet, (1, 0, 0), (0.0, passed, 1.5)) == pytest.approx(
            0.25 * np.sqrt(1 - (passed / 1.5) ** 2), abs=1e-3
        )


def test_a_drum_has_a_side_and_a_lid(bullet):
    bullet.add(one_part("cylinder", (2.0, 2.0, 1.0), (0.0, 0.0, 0.5)), (10.0, 0.0, 0.0))
    assert bright(bullet, (1, 0, 0), (0.0, 0.5, 0.5)) == pytest.approx(0.25 * np.sqrt(0.75), 1e-2)
    assert bright(bullet, (1, 0, -1), (7.0, 0.0, 4.0)) == pytest.approx(0.25 * np.sqrt(0.5), 1e-3)


def test_parts_of_a_body_have_their_own_materials(bullet):
    """A car at 10 m, seen from behind: the boot below the waist, above it the window."""
    bullet.add(CATALOGUE["car"], (10.0, 0.0, 0.0))
    assert bright(bullet, (1, 0, 0), (0.0, 0.0, 0.5)) == pytest.approx(REFLECTANCES["dark paint"])
    assert bright(bullet, (1, 0, 0), (0.0, 0.0, 1.4)) == pytest.approx(REFLECTANCES["glass"])


def test_incidence_is_that_of_the_normals_of_pybullet(bullet, grid):
    """Every kind of body, some turned and one tilted, by every cell that meets one."""
    places = np.random.default_rng(3).uniform(-25, 25, (len(CATALOGUE), 2))
    for (x, y), kind in zip(places, CATALOGUE.values(), strict=True):
        if np.hypot(x, y) > 8 and max(kind.size) < 20:
            bullet.add(kind, (x, y, x))
    bullet.add(one_part("box", (2.0, 3.0, 2.0)), Frame(6.0, 2.0, 0.3, 0.5, 0.3, -0.4))
    ranges, bodies = bullet.cast(EYE, grid.directions, 50.0)
    ends = EYE + grid.directions * 50.0
    ours = brightness(bullet.primitives, EYE, grid.directions, ranges, bodies)
    checked = np.flatnonzero((bodies != NO_BODY) & (bodies != bullet.ground))[::7]
    hits = [
        pybullet.rayTest(EYE.tolist(), ends[n].tolist(), physicsClientId=bullet._client.number)[0]
        for n in checked
    ]
    normals = np.array([hit[4] for hit in hits])
    cosines = -(normals * grid.directions[checked]).sum(axis=1)
    # Divided by the cosine of PyBullet's normal there must be left a reflectance of the table.
    left = ours[checked] / cosines
    apart = np.abs(left[:, None] - np.array([*REFLECTANCES.values()])).min(axis=1)
    assert len(checked) > 300
    assert np.quantile(apart, 0.99) < 1e-3


@pytest.mark.parametrize("engine", sorted(ENGINES))
def test_both_engines_give_the_same_surfaces(bullet, grid, engine):
    """But for a millimetre on round legs, which at their rims is a hundredth of a cosine."""
    for kind, pose in (("bus", (12.0, 4.0, 0.3)), ("adult", (7.0, -1.0, 1.0))):
        bullet.add(CATALOGUE[kind], pose)
    ranges, bodies = bullet.cast(EYE, grid.directions, 50.0)
    theirs = brightness(bullet.primitives, EYE, grid.directions, ranges, bodies)
    cast, met = ENGINES[engine](bullet, grid).cast(SENSOR, np.arange(grid.size))
    own = brightness(bullet.primitives, EYE, grid.directions, cast, met)
    assert (np.abs(own - theirs) > 0.03).sum() <= 1
    assert (np.abs(own - theirs) > 1e-3).mean() < 1e-3
