"""How episodes that were played again compare with the published ones."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from care_sim.measure.certify.design import drawn
from care_sim.measure.certify.playing import Trails
from care_sim.measure.certify.published import combined
from care_sim.measure.certify.trail import first_difference

_NOT_PLAYED = "not played"


@dataclass(frozen=True)
class Verdict:
    """The hash of the `episodes` that were played of those that were `asked` for, None with holes;
    and of the episodes that differ, by number, at which stage and keyframe, or why they failed.
    """

    episodes: int
    asked: int
    hash: str | None
    differing: Mapping[int, tuple[str, int | None]]
    failures: Mapping[int, str]
    only: int | None = None
    """The number of the episode where one alone was asked for."""

    @property
    def as_published(self) -> bool:
        """Whether none of those played failed or differs."""
        return not self.differing

    def lines(self) -> Iterator[str]:
        """What is printed."""
        fewer = f"{self.episodes:,} of " if self.episodes < self.asked else ""
        counted = f"{fewer}{self.asked:,} episodes" if self.asked > 1 else "1 episode"
        if self.as_published:
            yield f"{counted}: {self.hash}, as published"
            if self.only is not None:
                yield _made_of(self.only)
            return
        stages = Counter(name for name, _ in self.differing.values())
        told = ", ".join(f"{count:,} {_where(name)}" for name, count in stages.most_common())
        yield f"{counted}: {self.hash or 'no hash'}, not as published: {told}"

        # The first of them in detail, with the command that plays it alone.
        first = min(self.differing)
        name, keyframe = self.differing[first]
        moment = "" if keyframe is None else f", keyframe {keyframe}"
        reason = self.failures.get(first) or f"which differs first in {name}{moment}"
        yield f"the first is episode {first}, {reason}"
        yield _made_of(first)
        if self.only is None:
            yield f"  care-sim certify --episode {first}"


def verdict_of(found: Trails, published: Sequence[bytes], asked: int = 0) -> Verdict:
    """Compare trails with the published ones of the same numbers; `asked` is how many episodes were
    asked for, where not all of them were played.
    """
    failures = {number: trail for number, trail in sorted(found.items()) if isinstance(trail, str)}
    trails = {number: trail for number, trail in sorted(found.items()) if isinstance(trail, bytes)}
    parted = {
        number: first_difference(published[number], trail)
        for number, trail in trails.items()
        if trail != published[number]
    }
    differing = parted | dict.fromkeys(failures, (_NOT_PLAYED, None))
    asked = asked or len(found)
    return Verdict(
        episodes=len(found),
        asked=asked,
        hash=None if failures else combined([*trails.values()]),
        differing=differing,
        failures=failures,
        only=next(iter(found)) if asked == 1 else None,
    )


def _made_of(number: int) -> str:
    return f"  {drawn(number).text}, played in mode {drawn(number).mode}"


def _where(name: str) -> str:
    return name if name == _NOT_PLAYED else f"first in {name}"
