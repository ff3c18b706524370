import numpy as np
import pytest

from care_sim.core.frames import Frame
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.world.bodies import CATALOGUE
from care_sim.world.bullet import NO_BODY, BulletWorld
from care_sim.world.bullet_bodies import borrow, give_back, pybullet

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
    monkeypatch.setattr("care_sim.world.bullet_bodies._free", [])
    fresh = BulletWorld(ground)
    assert again._client.number != fresh._client.number
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
    for world in (first, second):
        assert world.cast(SENSOR.origin, AHEAD, 50.0)[1].tolist() == [NO_BODY, world.ground]
    first.close()
    second.close()


def test_a_world_that_is_not_asked_borrows_no_client(monkeypatch):
    monkeypatch.setattr("care_sim.world.bullet_bodies._free", free := [borrow()])
    world = BulletWorld()
    bus = world.add(CATALOGUE["bus"], (30.0, 0.0, 0.0))
    world.move(bus, (10.0, 0.0, 0.0))
    assert len(free) == 1
    ranges, ids = world.cast(SENSOR.origin, AHEAD[:1], 50.0)
    assert (ids.tolist(), free) == ([bus], [])
    assert ranges[0] < 10.0
    world.close()
    assert len(free) == 1


@pytest.mark.parametrize("asked", [True, False])
def test_who_has_closed_is_refused_and_takes_no_client(asked):
    world = BulletWorld()
    if asked:
        world.cast(SENSOR.origin, AHEAD, 50.0)
    world.close()
    with pytest.raises(pybullet.error):
        world.cast(SENSOR.origin, AHEAD, 50.0)


def test_whoever_does_not_close_gives_the_client_back_with_the_last_reference(monkeypatch):
    monkeypatch.setattr("care_sim.world.bullet_bodies._free", free := [])
    world = BulletWorld()
    world.cast(SENSOR.origin, AHEAD, 50.0)
    number = world._client.number
    del world
    assert free == [number]
