"""PyBullet and its clients within this process, which are used again and again.

To connect a client costs more than to empty one.
"""

from weakref import finalize

from care_sim.base.extras import STANDARD_ERROR, silenced

with silenced(STANDARD_ERROR):  # where it prints its build time
    import pybullet

__all__ = ["LentClient", "borrow", "give_back", "leave", "pybullet"]

MOST_FREE = 4
"""Clients kept for whoever borrows next. Each holds 28 MB, and another one takes 14 ms."""

_CLOSED = -1
"""What PyBullet calls no client."""

_free: list[int] = []


class LentClient:
    """A client that is borrowed when it is first asked for: to empty one takes a millisecond, and
    many a world never needs it. Where it is not closed, it is given back with the last reference.
    """

    def __init__(self) -> None:
        self._number: int | None = None
        self._abandoned: finalize[[int], LentClient] | None = None

    @property
    def number(self) -> int:
        """What PyBullet calls it."""
        if self._number is None:
            # Whoever does not close leaves the client to others when it is collected. At the end of
            # the process there are none.
            self._number = borrow()
            self._abandoned = finalize(self, leave, self._number)
            self._abandoned.atexit = False
        return self._number

    def __getstate__(self) -> dict[str, object]:
        # Two owners of one client would empty it for each other: a copy borrows its own.
        return {"_number": _CLOSED if self.closed else None, "_abandoned": None}

    @property
    def closed(self) -> bool:
        """Whether `close` was called."""
        return self._number == _CLOSED

    def close(self) -> None:
        """Give the client back; calling it again does nothing."""
        if self._abandoned is not None and self._abandoned.detach():
            give_back(self.number)
        # PyBullet refuses whoever asks it now.
        self._number = _CLOSED


def borrow() -> int:
    """An empty client. One that somebody else has closed or filled meanwhile is no trouble."""
    # Whatever finalisers have left is looked at only here, where PyBullet may be called.
    _end_surplus()
    while (client := _next_free()) is not None:
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


def _next_free() -> int | None:
    # Another thread may take the last one between a look and a grasp.
    try:
        return _free.pop()
    except IndexError:
        return None


def _end_surplus() -> None:
    while len(_free) > MOST_FREE and (client := _next_free()) is not None:
        if pybullet.isConnected(client):
            pybullet.disconnect(client)
