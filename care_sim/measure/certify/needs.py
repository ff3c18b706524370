"""What episodes of the list need that is not installed with the package itself."""

from collections.abc import Callable, Sequence
from importlib.util import find_spec

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_open3d
from care_sim.measure.certify.design import SUBPROCESS, Drawn

FARTHEST = "farthest-points"


def stable_baselines3() -> None:
    """Raise MissingExtra where it is not installed; to import it takes seconds."""
    if find_spec("stable_baselines3") is None:
        raise MissingExtra("Stable-Baselines3 needs the extra 'rl': pip install 'care-sim[rl]'")


NEEDS: tuple[tuple[Callable[[Drawn], bool], Callable[[], object]], ...] = (
    (lambda episode: episode.policy == FARTHEST, import_open3d),
    (lambda episode: episode.mode == SUBPROCESS, stable_baselines3),
)
"""Which episodes need it, and what raises MissingExtra where it is not there."""


def playable_here(episodes: Sequence[Drawn]) -> tuple[list[Drawn], list[str]]:
    """The episodes that can be played with what is installed, and a line for each thing that others
    lack.
    """
    left, lines = list(episodes), []
    for needed, load in NEEDS:
        lacking = [episode for episode in left if needed(episode)]
        try:
            if lacking:
                load()
        except MissingExtra as error:
            left = [episode for episode in left if not needed(episode)]
            lines.append(f"{len(lacking):,} of {len(episodes):,} not played: {error}")
    return left, lines
