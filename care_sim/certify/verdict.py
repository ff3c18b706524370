"""How episodes that were played again compare with the published ones."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from care_sim.certify.design import drawn
from care_sim.certify.playing import Trails
from care_sim.certify.published import combined
from care_sim.certify.trail import first_difference

_NOT_PLAYED = "not played"


@dataclass(frozen=True)
class Verdict:
    """The verdict on played trails. `asked` are the episodes to play, `found` their trails.
    `differing` maps an episode's number to the stage and keyframe of its first difference from the
    published trail.
    """

    found: Trails
    asked: int
    differing: Mapping[int, tuple[str, int | None]]

    @property
    def as_published(self) -> bool:
        """Whether none of those played failed or differs."""
        return not self.differing

    @property
    def hash(self) -> str | None:
        """The hash of the episodes that were played, None where one failed."""
        trails = [trail for _, trail in sorted(self.found.items()) if isinstance(trail, bytes)]
        return combined(trails) if len(trails) == len(self.found) else None

    def lines(self) -> Iterator[str]:
        """Yield the lines that are printed."""
        fewer = f"{len(self.found):,} of " if len(self.found) < self.asked else ""
        counted = f"{fewer}{self.asked:,} episodes" if self.asked > 1 else "1 episode"
        if self.as_published:
            yield f"{counted}: {self.hash}, as published"
            if self.asked == 1:
                yield f"  {drawn(min(self.found)).text}"
            return
        stages = Counter(name for name, _ in self.differing.values())
        told = ", ".join(
            f"{count:,} {name if name == _NOT_PLAYED else f'first in {name}'}"
            for name, count in stages.most_common()
        )
        yield f"{counted}: {self.hash or 'no hash'}, not as published: {told}"

        # The first of them in detail, with the command that plays it alone.
        first = min(self.differing)
        name, keyframe = self.differing[first]
        moment = "" if keyframe is None else f", keyframe {keyframe}"
        trail = self.found[first]
        reason = trail if isinstance(trail, str) else f"which differs first in {name}{moment}"
        yield f"the first is episode {first}, {reason}"
        yield f"  {drawn(first).text}"
        if self.asked > 1:
            yield f"  care-sim certify --episode {first}"


def verdict_of(
    found: Trails, published: Sequence[bytes], narrow: Mapping[int, bytes], asked: int = 0
) -> Verdict:
    """Compare trails with the published ones of the same numbers; those of processors without
    AVX-512, `narrow` by number, count as these. `asked` is how many episodes were asked for, where
    not all of them were played.
    """
    # All processors that play as published get the same hash.
    found = {n: published[n] if trail == narrow.get(n) else trail for n, trail in found.items()}
    differing: dict[int, tuple[str, int | None]] = {}
    for number, trail in found.items():
        if isinstance(trail, str):
            differing[number] = _NOT_PLAYED, None
        elif trail != published[number]:
            differing[number] = first_difference(published[number], trail)
    return Verdict(found, asked or len(found), differing)
