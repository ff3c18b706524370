"""Scenes of a source to learn from, and those that are held out of the learning.

Each part has whole scenes, and no scene is in both. Truth is what the source annotates: an object
without an annotation at a keyframe is not there, and a return in no box is one of the surroundings.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from typing import Any
from zlib import crc32

import numpy as np

from care_sim.base.digests import combined_digest
from care_sim.base.errors import InvalidInput, shown
from care_sim.sources.installed import SOURCES
from care_sim.sources.scenes import Scene, Source, film_of
from care_sim.training.supervised.worlds import World

HELD_OUT_EVERY = 5
"""Of so many scenes one is held out, where no split of its own is."""
MOST_HELD_OUT = 48
"""Scenes that are played to say what was reached; of more, so many are taken at equal steps."""
SCENES_KEPT = 50
"""So many scenes give all their keyframes. Of more a share is drawn, which takes no more memory."""


@dataclass(frozen=True)
class Scenes:
    """The scenes of a `source` that are `learned` from, and those that are `held_out`. `splits`
    name the splits of both, where the source has some, and `play` are the words of the command
    that plays the weights on what is held out. `told` is what a card says of the data: which
    scenes, and a digest of the files of each part.
    """

    source: Source
    learned: tuple[Scene, ...]
    held_out: tuple[Scene, ...]
    splits: tuple[str, str] = ("", "")
    play: tuple[str, ...] = ()
    told: dict[str, Any] = field(init=False)

    def __post_init__(self) -> None:
        # Before anything is learned: a file that is missing is told at once.
        object.__setattr__(self, "told", self._told())

    def worlds(self, part: Sequence[Scene], turn: int = 0) -> list[World]:
        """A world of every scene of a part. Another `turn` plays the scenes in another way."""
        share = min(1.0, SCENES_KEPT / len(part))
        return [self._world(scene, turn, share) for scene in part]

    def endless(self) -> Iterator[World]:
        """The scenes that are learned from, again and again in another order, each time another
        play.
        """
        for turn in count():
            for row in np.random.default_rng(turn).permutation(len(self.learned)).tolist():
                yield self._world(self.learned[row], turn)

    def _told(self) -> dict[str, Any]:
        parts = [
            f"{len(part)} scene{'s' * (len(part) > 1)} {doing}{split and f', split {split}'}"
            f"{self._digest(part)}"
            for part, split, doing in (
                (self.learned, self.splits[0], "learned from"),
                (self.held_out, self.splits[1], "held out"),
            )
        ]
        return {
            "data": f"{self.source.kind}, {'; '.join(parts)}{self._reading}",
            "seeds": {
                "scenes learned from": [scene.name for scene in self.learned],
                "scenes held out": [scene.name for scene in self.held_out],
            },
        }

    @property
    def terms(self) -> str:
        """The end of what a card says: the licence of the recordings."""
        licence = getattr(SOURCES.maker(self.source.kind), "licence", "")
        return (
            f"; these weights are under the licence of the recordings: {licence}" if licence else ""
        )

    def _world(self, scene: Scene, turn: int, share: float = 1.0) -> World:
        # Scenes of recordings share one seed, so what is drawn hangs on the name.
        seed = crc32(f"{scene.name} {turn}".encode())
        return World("scene", seed, partial(film_of, self.source, scene), share)

    def _digest(self, part: Sequence[Scene]) -> str:
        rows = [self.source.row(scene) for scene in part]
        digests = [row["recording"] for row in rows if row.get("recording")]
        return f", digest {combined_digest(digests)}" if digests else ""

    @property
    def _reading(self) -> str:
        """How the first scene is read, where that is not the usual way."""
        row: Mapping[str, Any] = self.source.row(self.learned[0])
        told = [f"{name} {row[name]}" for name in row if name not in ("source", "recording")]
        return f"; read with {', '.join(told)}" if told else ""


def parted(
    source: Source, scenes: Sequence[Scene], apart: Sequence[Scene] | None = None
) -> tuple[tuple[Scene, ...], tuple[Scene, ...]]:
    """The scenes to learn from, and those that are held out: the scenes `apart`, or else one in
    `HELD_OUT_EVERY` of all, from the last on.

    Raises InvalidInput where a scene is in both, and for a single one without another to hold out.
    """
    if apart is None:
        if len(scenes) < 2:
            raise InvalidInput(
                f"source {source.kind} has one scene here, {shown(scenes[0].name)}; training needs "
                "two: one to learn from, one held out"
            )
        apart = _thinned(scenes[::-1][::HELD_OUT_EVERY][::-1])
        return tuple(scene for scene in scenes if scene not in apart), tuple(apart)
    if both := {scene.name for scene in scenes} & {scene.name for scene in apart}:
        raise InvalidInput(
            f"{len(both)} scenes are learned from and held out, {shown(min(both))} is one; the "
            "splits must share none"
        )
    return tuple(scenes), tuple(_thinned(apart))


def _thinned(scenes: Sequence[Scene]) -> list[Scene]:
    rows = np.linspace(0, len(scenes) - 1, min(len(scenes), MOST_HELD_OUT))
    return [scenes[row] for row in rows.round().astype(int).tolist()]
