"""PyBullet's clients within this process, used again and again: to connect costs more than to empty one."""

from care_sim.world.quiet_pybullet import pybullet

_free: list[int] = []


def borrow() -> int:
    """An empty client. One that somebody else has closed or filled meanwhile is no trouble."""
    while _free:
        client = _free.pop()
        if pybullet.isConnected(client):
            pybullet.resetSimulation(physicsClientId=client)
            return client
    return int(pybullet.connect(pybullet.DIRECT))


def give_back(client: int) -> None:
    """Leave a client to whoever borrows the next one."""
    _free.append(client)
