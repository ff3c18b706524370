"""Two policies on the same scenes: difference or ratio of their detections, with intervals (paper,
Sec. 3, Sec. 5.2 and Table 1).

Policies are paired by scene and whole scenes are resampled, since the events of a scene are not
independent. A measure leaves out scenes without an event, or without an object frame.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.evaluation.bootstrap import Interval, paired_difference, ratio_of_sums
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.recall import Tally

Tallies = Mapping[str, Tally]
"""The tally of every scene, by its name."""


@dataclass(frozen=True)
class Ratio:
    """A measure that is a ratio of sums of a tally, `scale` times, in `unit`."""

    name: str
    unit: str
    scale: float
    numerator: Callable[[Tally], float]
    denominator: Callable[[Tally], float]

    def of(self, tally: Tally) -> float | None:
        """Its value, None where there is nothing to find."""
        return (
            self.scale * self.numerator(tally) / self.denominator(tally)
            if self.denominator(tally)
            else None
        )


FIRST_SIGHTING = Ratio(
    "first-sighting recall", "points", 100.0, lambda t: t.sighted, lambda t: t.events
)
OVERALL = Ratio("overall recall", "points", 100.0, lambda t: t.found, lambda t: t.frames)
TTFD = Ratio("censored TTFD", "keyframes", 1.0, lambda t: t.delay, lambda t: t.events)


@dataclass(frozen=True)
class RatioLevel:
    """A measure of one policy, with equal weight per event and with equal weight per scene; None
    without any.
    """

    by_event: float | None
    by_scene: float | None


@dataclass(frozen=True)
class SceneContrast:
    """One policy minus another in the unit of `ratio`, over `scenes` with `weight` events (or
    object frames) in all.

    `by_event` has equal weight per event, `by_scene` per scene.
    """

    ratio: Ratio
    by_event: Interval
    by_scene: Interval
    scenes: int
    weight: float

    @property
    def excludes_zero(self) -> bool:
        """Return True if the interval of the events excludes zero; False for fewer than 5
        scenes.
        """
        return self.scenes >= FEWEST_PAIRS and (self.by_event.low > 0 or self.by_event.high < 0)


@dataclass(frozen=True)
class SceneShare:
    """One policy's detections in % of another's. `scenes` counts the scenes in which the other
    detected anything.
    """

    interval: Interval
    scenes: int


def averaged(seeds: Sequence[Tallies]) -> dict[str, Tally]:
    """The mean tally of every scene over floor seeds, of the scenes that all seeds have.

    Raises InvalidInput where the seeds do not count the same events and object frames of a scene.
    """
    # The mean comes before the pairing: floor seeds of a scene are not separate scenes, and as
    # samples they would make the interval too narrow.
    scenes = sorted(set.intersection(*(set(seed) for seed in seeds))) if seeds else []
    return {scene: _mean(scene, [seed[scene] for seed in seeds]) for scene in scenes}


def among(tallies: Tallies, scenes: Collection[str]) -> Tallies:
    """The tallies of some of the scenes, in their own order."""
    kept = set(scenes)
    return {scene: tally for scene, tally in tallies.items() if scene in kept}


def ratio_level(ratio: Ratio, tallies: Tallies) -> RatioLevel:
    """The measure of one policy over its scenes."""
    values = [value for value in map(ratio.of, tallies.values()) if value is not None]
    return RatioLevel(
        ratio.of(sum(tallies.values(), Tally())), float(np.mean(values)) if values else None
    )


def scene_contrast(ratio: Ratio, ours: Tallies, theirs: Tallies) -> SceneContrast | None:
    """Return `ours` minus `theirs` on the scenes that both have; None if they hold nothing to
    detect.

    Raises InvalidInput where the two do not count the same events or object frames of a scene.
    """
    pairs = _pairs(ratio, ours, theirs)
    if not pairs:
        return None
    a, b, weights = _columns(ratio, pairs)
    # Both policies have the same events, so the sum of differences over the sum of events is the
    # difference of the pooled measures.
    by_event = ratio_of_sums((a - b, weights))
    by_scene = paired_difference(a / weights, b / weights)
    return SceneContrast(ratio, by_event, by_scene, len(pairs), float(weights.sum()))


def scene_share(ratio: Ratio, ours: Tallies, whole: Tallies) -> SceneShare | None:
    """Return `ours` in % of the `whole` on the scenes that both have; None if the whole detected
    nothing.

    The share is a quotient of two recalls of the same objects. Ours may detect other objects than
    the whole, so the share can exceed 100. Raises InvalidInput as `scene_contrast` does.
    """
    a, b, _ = _columns(ratio, _pairs(ratio, ours, whole))
    # Our detections count also where the whole has none: both recalls are of all scenes. The
    # interval depends only on the scenes in the denominator.
    rich = int(np.count_nonzero(b))
    if not rich:
        return None
    # A scene is drawn with what both found in it: the two are paired within the resamples too.
    return SceneShare(ratio_of_sums((100 * a, b)), rich)


def contrast_gap(
    ratio: Ratio,
    ours: Tallies,
    theirs: Tallies,
    first: Collection[str],
    second: Collection[str],
) -> Interval | None:
    """Return how much larger the contrast is in the `first` scenes (the dense third) than in the
    `second`, with equal weight per event.

    Returns None if either group has fewer than two scenes with something to detect. Raises
    InvalidInput for groups that share a scene.
    """
    if shared := sorted(set(first) & set(second)):
        raise InvalidInput(
            f"groups of scenes to be compared must share none, got {shared[0]} in both"
        )
    groups = [
        _columns(ratio, _pairs(ratio, among(ours, some), among(theirs, some)))
        for some in (first, second)
    ]
    if min(len(group.T) for group in groups) < 2:
        return None
    # Each group is paired by scene within itself; scenes of the two have nothing in common, so the
    # groups are resampled apart.
    (a, b, weights), (c, d, others) = groups
    return ratio_of_sums((a - b, weights), less=(c - d, others))


def _pairs(ratio: Ratio, ours: Tallies, theirs: Tallies) -> list[tuple[Tally, Tally]]:
    """Return the tallies of shared scenes with something to detect."""
    # In order of name: the resampling draws rows, so their order is a part of its result.
    pairs = [(scene, ours[scene], theirs[scene]) for scene in sorted(set(ours) & set(theirs))]
    for scene, a, b in pairs:
        _check_same(scene, [a, b])
    return [(a, b) for _, a, b in pairs if ratio.denominator(a)]


def _columns(ratio: Ratio, pairs: Sequence[tuple[Tally, Tally]]) -> Floats:
    """(3, n) numerators of ours and theirs, to scale, and denominators."""
    rows = [(ratio.numerator(a), ratio.numerator(b), ratio.denominator(a)) for a, b in pairs]
    return np.array(rows, float).reshape(-1, 3).T * [[ratio.scale], [ratio.scale], [1.0]]


def _mean(scene: str, tallies: Sequence[Tally]) -> Tally:
    _check_same(scene, tallies)
    total = sum(tallies, Tally())
    return Tally(*(getattr(total, column.name) / len(tallies) for column in fields(Tally)))


def _check_same(scene: str, tallies: Sequence[Tally]) -> None:
    counts = {(tally.events, tally.frames) for tally in tallies}
    if len(counts) > 1:
        listed = " and ".join(
            f"{events:g} events in {frames:g} object frames" for events, frames in sorted(counts)
        )
        raise InvalidInput(
            f"scene {scene}: the tallies to be compared must be of one film, got {listed}"
        )
