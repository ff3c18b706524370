import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.streets.layouts import Curve
from care_sim.streets.people import Walked

curves = st.builds(
    Curve,
    st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3)),
    st.floats(0, 60),
    st.floats(1, 60),
    st.floats(-1 / 30, 1 / 30),
)


def places(s, d=0.0, heading=0.0):
    return np.stack(
        [np.asarray(s, dtype=float), np.full(np.shape(s), d), np.full(np.shape(s), heading)],
        axis=-1,
    )


def test_a_straight_road_is_its_own_coordinates():
    assert Curve().to_world(np.array([12.0, -3.0, 0.4])) == pytest.approx([12.0, -3.0, 0.4])


@pytest.mark.parametrize("side", [1, -1])
def test_a_quarter_turn_of_radius_30_ends_where_geometry_says(side):
    curve = Curve((0.0, 0.0, 0.0), 10.0, 15.0 * np.pi, side / 30.0)
    end = curve.to_world(places(10.0 + 15.0 * np.pi + 5.0))
    assert end == pytest.approx([40.0, side * 35.0, side * np.pi / 2])
    assert curve.curvature_at(20.0) == side / 30.0
    assert (curve.curvature_at(9.9), curve.curvature_at(10.0 + 15.0 * np.pi)) == (0.0, 0.0)


@given(curves)
def test_the_reference_line_has_unit_speed_and_points_along_itself(curve):
    s = np.linspace(-20, 150, 341)
    x, y, heading = curve.to_world(places(s)).T
    dx, dy = np.diff(x), np.diff(y)
    assert np.hypot(dx, dy) == pytest.approx(np.diff(s), rel=1e-3)
    middle = (heading[1:] + heading[:-1]) / 2
    assert np.cos(np.arctan2(dy, dx) - middle).min() > 1 - 1e-3
    assert heading == pytest.approx(curve.heading(s))


@given(curves, st.floats(-20, 120), st.floats(-12, 12))
def test_d_is_the_distance_to_the_left_of_the_line(curve, s, d):
    on, off = curve.to_world(places([s, s], 0.0)), curve.to_world(places([s, s], d))
    left = np.array([-np.sin(on[0, 2]), np.cos(on[0, 2])])
    assert off[0, :2] - on[0, :2] == pytest.approx(d * left, abs=1e-9)


@given(curves, st.floats(0.5, 6.0), st.floats(-9.0, 9.0))
def test_a_walker_keeps_the_speed_also_beside_a_bend(curve, speed, d):
    times = np.arange(0, 10, 0.5)
    poses = Walked(curve, ((0.0, d), (150.0, d)), speed).poses(times)
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T) / 0.5
    assert steps.max() <= speed + 1e-9
    assert steps.min() > 0.97 * speed


def test_a_walker_turns_at_corners_and_stands_at_both_ends():
    way = Walked(Curve(), ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0)), 1.0, starts_s=2.0)
    poses = way.poses(np.array([0.0, 2.0, 4.0, 7.0, 20.0]))
    assert poses[:, :2] == pytest.approx(np.array([[0, 0], [0, 0], [2, 0], [4, 1], [4, 3]]))
    assert poses[:, 2] == pytest.approx([0, 0, 0, np.pi / 2, np.pi / 2])


def test_a_walker_follows_the_bend_of_the_pavement():
    curve = Curve((0.0, 0.0, 0.0), 10.0, 15.0 * np.pi, 1 / 30.0)
    poses = Walked(curve, ((10.0, -8.0), (10.0 + 15.0 * np.pi, -8.0)), 1.5).poses(
        np.arange(0, 30, 0.5)
    )
    assert np.hypot(poses[:, 0] - 10.0, poses[:, 1] - 30.0) == pytest.approx(38.0, abs=0.01)
