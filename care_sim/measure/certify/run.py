"""`care-sim certify`: play the list, compare, tell."""

import sys
from collections.abc import Sequence
from contextlib import nullcontext

from care_sim.base.errors import InvalidInput, MissingExtra, report_problems
from care_sim.measure.certify.config import CertifyConfig
from care_sim.measure.certify.design import drawn
from care_sim.measure.certify.needs import playable_here
from care_sim.measure.certify.playing import Trails, trails_of
from care_sim.measure.certify.published import combined, read, write
from care_sim.measure.certify.verdict import verdict_of
from care_sim.study.progress import ProgressLines, progress_bar


def run_certify(config: CertifyConfig) -> int:
    """Play the list and tell; 0 where every episode that can be played here goes as published, else
    1.

    Raises MissingExtra where none can be played, or not all that are to be published.
    """
    published = [] if config.write else read()
    if config.numbers[-1] >= len(published) and not config.write:
        raise InvalidInput(f"the published list has {len(published):,} episodes")
    episodes, lacking = playable_here([drawn(number) for number in config.numbers])
    if lacking and (config.write or not episodes):
        raise MissingExtra("; ".join(lacking))
    report_problems(lacking)
    found = _played([episode.number for episode in episodes], config.workers)
    if config.write:
        return _published(found)
    verdict = verdict_of(found, published, len(config.numbers))
    print(*verdict.lines(), sep="\n")
    return 0 if verdict.as_published else 1


def _played(numbers: Sequence[int], workers: int) -> Trails:
    total = len(numbers)
    with (
        progress_bar(total, "episodes")
        if sys.stderr.isatty()
        else nullcontext(ProgressLines(total, "episodes")) as show
    ):
        return trails_of(numbers, workers, lambda done: show(done, ""))


def _published(found: Trails) -> int:
    """Publish what was played, unless some of it was not."""
    trails = [trail for _, trail in sorted(found.items()) if isinstance(trail, bytes)]
    if len(trails) < len(found):
        number, reason = next(
            (n, trail) for n, trail in sorted(found.items()) if isinstance(trail, str)
        )
        print(f"nothing is written: episode {number} was not played: {reason}")
        return 1
    write(trails)
    print(f"{len(trails):,} episodes: {combined(trails)}, published")
    return 0
