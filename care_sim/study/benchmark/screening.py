"""Which worlds count: those in which sensing decides something.

A drive or a test counts where a car that detects nothing collides and the full scan does not: what
lies between them is left to the choice of cells. A street counts with the first sightings that the
full scan finds at once. Two plays decide, and none of a policy that is scored.
"""

from itertools import islice
from pathlib import Path

from care_sim.base.errors import InvalidInput
from care_sim.study.benchmark.player import Player, player_in
from care_sim.study.benchmark.tasks import configurations, reached
from care_sim.study.benchmark.worlds import (
    PARTS,
    SIZES,
    STREETS,
    Salt,
    World,
    candidates,
    publish_worlds,
)
from care_sim.study.run_config import FULL, Row

_BLIND = {"min_returns": 10**9}
"""More returns than there are cells: a car that detects nothing, whatever it fires."""
_UNASKED = "random"
"""The policy of that car, which chooses nothing."""


def screened_worlds(player: Player, salt: Salt | None = None) -> list[World]:
    """The first worlds of every part that count: of the published seeds, or of a salt.

    Raises InvalidInput where one cannot be played.
    """
    return [world for part in PARTS for world in _screened(part, player, salt)]


def publish_screened(folder: Path, workers: int) -> None:
    """For maintainers: find the worlds that count, and make them those that everybody plays."""
    with player_in(folder, workers) as player:
        publish_worlds(screened_worlds(player))


def _screened(part: str, player: Player, salt: Salt | None) -> list[World]:
    found: list[World] = []
    waiting = candidates(part, salt)
    # As many at a time as are still missing: the journal keeps what was looked at.
    while missing := SIZES[part] - len(found):
        drawn = [*islice(waiting, missing)]
        most = reachable(part, [seed for _, seed in drawn], player)
        found += [
            World(part, *named, each) for named, each in zip(drawn, most, strict=True) if each
        ]
    return found


def reachable(part: str, seeds: list[int], player: Player) -> list[int]:
    """What there is to reach in the worlds of these seeds."""
    full = _rows(player, part, seeds, FULL)
    if part == STREETS:
        return [reached(part, row) for row in full]
    blind = _rows(player, part, seeds, _UNASKED, **_BLIND)
    return [
        int(row["collision"] and not seen["collision"])
        for seen, row in zip(full, blind, strict=True)
    ]


def _rows(player: Player, part: str, seeds: list[int], policy: str, **given: int) -> list[Row]:
    rows = player.rows(configurations(part, seeds, policy, **given))
    if player.failures:
        raise InvalidInput(f"a world could not be screened: {player.failures[0]}")
    return [row for row in rows if row is not None]
