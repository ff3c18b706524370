"""PyBullet's clients within this process, used again and again: to connect costs more than to empty
one.
"""

from care_sim.world.quiet_pybullet import pybullet

MOST_FREE = 4
"""Clients kept for whoever borrows next. Each holds 28 MB, and another one takes 14 ms."""

_free: list[int] = []


def borrow() -> int:
    """An empty client. One that somebody else has closed or filled meanwhile is no trouble."""
    _end_surplus()
    while _free:
        client = _free.pop()
        if pybullet.isConnected(client):
            pybullet.resetSimulation(physicsClientId=client)
            return client
    return int(pybullet.connect(pybullet.DIRECT))


def give_back(client: int) -> None:
    """Leave a client to whoever borrows the next one."""
    leave(client)
    _end_surplus()


def leave(client: int) -> None:
    """Give a client back where PyBullet may not be called: garbage is collected in the middle of
    its calls, too.
    """
    _free.append(client)


def _end_surplus() -> None:
    while len(_free) > MOST_FREE:
        client = _free.pop()
        if pybullet.isConnected(client):
            pybullet.disconnect(client)
