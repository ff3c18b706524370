import numpy as np
import pytest

from care_sim.core.frames import Frame
from care_sim.core.types import Ego
from care_sim.sources.box_films import motions

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


def test_the_first_pose_has_no_motion_and_the_second_a_speed():
    first, second = motions(TIMES[:2], on_a_line([0.0, 2.0]))
    assert first == Ego()
    assert (second.speed, second.acceleration) == (pytest.approx(4.0), 0.0)


def test_after_a_keyframe_of_braking_all_of_it_is_told():
    """10 m/s, from 1 s on losing 3 m/s every second, at 10 Hz."""
    times = np.arange(21) / 10
    braking = np.clip(times - 1.0, 0.0, None)
    ego = motions(times, on_a_line(10 * times - 1.5 * braking**2))[15]
    assert (ego.speed, ego.acceleration) == (pytest.approx(8.5), pytest.approx(-3.0))
