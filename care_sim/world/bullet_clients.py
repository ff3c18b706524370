"""PyBullet and its clients within this process, which are used again and again.

To connect a client costs more than to empty one.
"""

from care_sim.base.extras import STANDARD_ERROR, silenced

with silenced(STANDARD_ERROR):  # where it prints its build time
    import pybullet

__all__ = ["borrow", "give_back", "leave", "pybullet"]

MOST_FREE = 4
"""Clients kept for whoever borrows next. Each holds 28 MB, and another one takes 14 ms."""

_free: list[int] = []


def borrow() -> int:
    """An empty client. One that somebody else has closed or filled meanwhile is no trouble."""
    # Whatever finalisers have left is looked at only here, where PyBullet may be called.
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
    """Give a client back where PyBullet may not be called, as in a finaliser: garbage is collected
    in the middle of its calls, too.
    """
    _free.append(client)


def _end_surplus() -> None:
    while len(_free) > MOST_FREE:
        client = _free.pop()
        if pybullet.isConnected(client):
            pybullet.disconnect(client)
