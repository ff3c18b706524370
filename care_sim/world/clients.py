"""PyBullet's clients within this process, used again and again: to connect costs more than to empty one."""

from care_sim.world.quiet_pybullet import pybullet

_free: list[int] = []


def borrow() -> int:
    """An empty client."""
    return _free.pop() if _free else int(pybullet.connect(pybullet.DIRECT))


def give_back(client: int) -> None:
    """Empty a client, for whoever borrows the next one."""
    pybullet.resetSimulation(physicsClientId=client)
    _free.append(client)
