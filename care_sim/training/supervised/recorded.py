"""Scenes of a source for training, and held-out ones.

Each part has whole scenes, and no scene is in both. The annotations are truth: an object without an
annotation at a keyframe is absent, and a return in no box belongs to the surroundings.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from typing import Any
from zlib import crc32

import numpy as np

from care_sim.base.digests import combined_digest
from care_sim.base.errors import InvalidInput, report_problems, shown
from care_sim.envs import OPEN_LOOP
from care_sim.sources.installed import SOURCES
from care_sim.sources.scenes import Scene, Source, Streets, film_of
from care_sim.training.supervised.worlds import World

_STREET, _REPLAY = OPEN_LOOP
HELD_OUT_EVERY = 5
"""One scene in five is held out if no validation split is named."""
MOST_HELD_OUT = 48
"""Scenes played for the results. More scenes are thinned at equal steps."""
SCENES_KEPT = 50
"""Up to 50 scenes use all their keyframes. More scenes use a share, so that memory stays the
same.
"""


@dataclass(frozen=True)
class Scenes:
    """The scenes of a `source` for training (`learned`) and those `held_out`. `splits` name the
    splits of both, if the source has some. `play` are the words of the command that plays the
    weights on held-out scenes. `told` is the card's description: sensor, scenario, scenes, a digest
    of the files of each part, and the terms of the recordings.
    """

    source: Source
    learned: tuple[Scene, ...]
    held_out: tuple[Scene, ...]
    splits: tuple[str, str] = ("", "")
    play: tuple[str, ...] = ()
    told: dict[str, Any] = field(init=False)

    def __post_init__(self) -> None:
        # Before training, so that a missing file is reported at once.
        object.__setattr__(self, "told", self._describe())

    def worlds(self, part: Sequence[Scene], turn: int = 0) -> list[World]:
        """Return a world of every scene of a part. Another `turn` plays the scenes differently."""
        share = min(1.0, SCENES_KEPT / len(part))
        return [self._world(scene, turn, share) for scene in part]

    def endless(self) -> Iterator[World]:
        """Yield the training scenes endlessly, each time in another order and play."""
        for turn in count():
            for row in np.random.default_rng(turn).permutation(len(self.learned)).tolist():
                yield self._world(self.learned[row], turn)

    def _describe(self) -> dict[str, Any]:
        parts = [
            f"{len(part)} scene{'s' * (len(part) > 1)} {doing}{split and f', split {split}'}"
            f"{self._digest(part)}"
            for part, split, doing in (
                (self.learned, self.splits[0], "learned from"),
                (self.held_out, self.splits[1], "held out"),
            )
        ]
        licence = getattr(SOURCES.maker(self.source.kind), "licence", "")
        return {
            "sensor": self.source.sensor,
            "scenario": _STREET if self.source.kind == Streets.kind else _REPLAY,
            "data": f"{self.source.kind}, {'; '.join(parts)}{self._reading}",
            "terms": f"; these weights are under the licence of the recordings: {licence}"
            if licence
            else "",
            "seeds": {
                "scenes learned from": [scene.name for scene in self.learned],
                "scenes held out": [scene.name for scene in self.held_out],
            },
        }

    def _world(self, scene: Scene, turn: int, share: float = 1.0) -> World:
        # Scenes of recordings share one seed, so the name decides the draws.
        seed = crc32(f"{scene.name} {turn}".encode())
        return World("scene", seed, partial(film_of, self.source, scene), share)

    def _digest(self, part: Sequence[Scene]) -> str:
        rows = [self.source.row(scene) for scene in part]
        digests = [row["recording"] for row in rows if row.get("recording")]
        return f", digest {combined_digest(digests)}" if digests else ""

    @property
    def _reading(self) -> str:
        """Return how the first scene is read, if not in the usual way."""
        row: Mapping[str, Any] = self.source.row(self.learned[0])
        told = [f"{name} {row[name]}" for name in row if name not in ("source", "recording")]
        return f"; read with {', '.join(told)}" if told else ""


def parted(
    source: Source, scenes: Sequence[Scene], apart: Sequence[Scene] | None = None
) -> tuple[tuple[Scene, ...], tuple[Scene, ...]]:
    """Split scenes into training and held-out ones. Held out are the scenes `apart`, or else whole
    logs with one scene in `HELD_OUT_EVERY`. Raises InvalidInput if a scene is in both parts, and
    for a single scene. Reports a log that is in both.
    """
    if apart is None:
        if len(scenes) < 2:
            raise InvalidInput(
                f"source {source.kind} has one scene here, {shown(scenes[0].name)}; training needs "
                "two: one to learn from, one held out"
            )
        apart = _whole_logs(source, scenes)
    elif both := {scene.name for scene in scenes} & {scene.name for scene in apart}:
        raise InvalidInput(
            f"{len(both)} scenes are learned from and held out, {shown(min(both))} is one; the "
            "splits must share none"
        )
    learned = tuple(scene for scene in scenes if scene not in apart)
    if shared := {*map(source.log, learned)} & {*map(source.log, apart)}:
        report_problems(
            [
                f"logs with scenes in both parts: {len(shared)}, such as {shown(min(shared))}: "
                "other streets may show less"
            ]
        )
    return learned, tuple(_thinned(apart))


def _whole_logs(source: Source, scenes: Sequence[Scene]) -> list[Scene]:
    """Return the scenes of the shortest logs, the last of equally long ones: many logs show many
    streets. For a single log, return its last scenes, which adjoin the others at one place only.
    """
    by_log: dict[str, list[Scene]] = {}
    for scene in scenes:
        by_log.setdefault(source.log(scene), []).append(scene)
    logs = [*by_log.values()] if len(by_log) > 1 else [[scene] for scene in scenes]
    wanted = min(-(-len(scenes) // HELD_OUT_EVERY), MOST_HELD_OUT)
    apart: set[Scene] = set()
    # From the shortest to the second longest, so that some logs remain for training.
    for log in sorted(logs, key=len, reverse=True)[:0:-1]:
        if len(apart) < wanted:
            apart.update(log)
    return [scene for scene in scenes if scene in apart]


def _thinned(scenes: Sequence[Scene]) -> list[Scene]:
    rows = np.linspace(0, len(scenes) - 1, min(len(scenes), MOST_HELD_OUT))
    return [scenes[row] for row in rows.round().astype(int).tolist()]
