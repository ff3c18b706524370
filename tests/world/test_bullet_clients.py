import numpy as np
import pytest

from care_sim.core.frames import Frame
from care_sim.sensors.camera import FRONT_CAMERA
from care_sim.world.bodies import CATALOGUE
from care_sim.world.bullet import NO_BODY, BulletWorld
from care_sim.world.bullet_clients import borrow, give_back, pybullet

AHEAD = np.array([[1.0, 0.0, 0.0], [0.9, 0.0, -np.sqrt(0.19)]])
SENSOR = Frame(0.0, 0.0, 1.84, 0.0)


def answers(world):
    bus = world.add(CATALOGUE["bus"], (30.0, 0.0, 0.3))
    ranges, ids = world.cast(SENSOR.origin, AHEAD, 50.0)
    return bus, ranges.tolist(), ids.tolist(), world.body_ids(FRONT_CAMERA, SENSOR).tobytes()


def test_a_client_is_used_again_and_empty():
    client = borrow()
    give_back(client)
    assert borrow() == client
    give_back(client)


def test_two_worlds_at_a_time_have_clients_of_their_own():
    first, second = BulletWorld(), BulletWorld()
    first.add(CATALOGUE["bus"], (30.0, 0.0, 0.0))
    assert second.cast(SENSOR.origin, AHEAD[:1], 50.0)[1].tolist() == [NO_BODY]
    first.close()
    second.close()


@pytest.mark.parametrize("ground", [True, False])
def test_a_world_answers_as_in_a_fresh_client_whatever_was_there_before(monkeypatch, ground):
    used = BulletWorld()
    for x in range(5, 25, 5):
        used.add(CATALOGUE["trailer"], (float(x), 0.0, 1.0), transparent=x == 5)
    used.close()
    again = BulletWorld(ground)
    after = answers(again)
    monkeypatch.setattr("care_sim.world.bullet_clients._free", [])
    fresh = BulletWorld(ground)
    assert again._client != fresh._client
    assert after == answers(fresh)
    again.close()
    fresh.close()


def test_closing_twice_gives_a_client_back_once():
    world = BulletWorld()
    world.close()
    world.close()
    first, second = borrow(), borrow()
    assert first != second
    give_back(first)
    give_back(second)


def test_a_client_that_somebody_filled_or_closed_is_no_trouble():
    filled, closed = borrow(), borrow()
    give_back(filled)
    give_back(closed)
    pybullet.createMultiBody(0, physicsClientId=filled)
    pybullet.disconnect(physicsClientId=closed)
    first, second = BulletWorld(), BulletWorld()
    assert first.ground == second.ground == 0
    first.close()
    second.close()
