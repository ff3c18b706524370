"""`care-sim certify`: play the list, compare, tell."""

import sys
from collections.abc import Sequence
from contextlib import nullcontext

from care_sim.certify.config import CertifyConfig
from care_sim.certify.design import SUBPROCESS, drawn
from care_sim.certify.modes import has_subprocesses
from care_sim.certify.playing import Played, played
from care_sim.certify.published import combined, read, write
from care_sim.certify.verdict import compare
from care_sim.errors import InvalidInput
from care_sim.study.progress import Lines, bar


def run(config: CertifyConfig) -> int:
    """Play the list and tell; 0 where every episode goes as published, else 1."""
    published = [] if config.write else read()
    if config.numbers[-1] >= len(published) and not config.write:
        raise InvalidInput(f"the published list has {len(published):,} episodes")
    _say_what_is_missing(config.numbers)
    found = _played(config.numbers, config.workers)
    if config.write:
        return _published(found)
    verdict = compare(found, published)
    print(*verdict.lines(), sep="\n")
    return 0 if verdict.as_published else 1


def _played(numbers: Sequence[int], workers: int) -> Played:
    total = len(numbers)
    with bar(total, "episodes") if sys.stderr.isatty() else nullcontext(Lines(total, "episodes")) as show:
        return played(numbers, workers, lambda done: show(done, ""))


def _published(found: Played) -> int:
    """Publish what was played, unless some of it was not."""
    trails = [trail for _, trail in sorted(found.items()) if isinstance(trail, bytes)]
    if len(trails) < len(found):
        number, reason = next((n, trail) for n, trail in sorted(found.items()) if isinstance(trail, str))
        print(f"nothing is written: episode {number} was not played: {reason}")
        return 1
    write(trails)
    print(f"{len(trails):,} episodes: {combined(trails)}, published")
    return 0


def _say_what_is_missing(numbers: Sequence[int]) -> None:
    many = sum(drawn(number).mode == SUBPROCESS for number in numbers)
    if many and not has_subprocesses():
        print(
            f"{many} episodes for the subprocesses of Stable-Baselines3 are played alone: "
            "they need the extra 'rl'; their hashes do not depend on it",
            file=sys.stderr,
        )
