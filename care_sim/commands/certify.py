"""`care-sim certify`: whether episodes go on this machine as published."""

from care_sim.base.errors import InvalidInput, MissingExtra, report_problems
from care_sim.base.interrupts import DONE, FAILED
from care_sim.certify import ALL_EPISODES, CERTIFIED_EPISODES, playing, published
from care_sim.certify.design import drawn
from care_sim.certify.verdict import verdict_of
from care_sim.commands.options.results import Certify
from care_sim.study.progress import shown_progress


def certify(options: Certify) -> int:
    """Play the list and print how it goes; fails unless every episode that can be played here goes
    as published.

    Raises MissingExtra where none can be played.
    """
    numbers = [*range(ALL_EPISODES if options.all else CERTIFIED_EPISODES)]
    if options.episode is not None:
        numbers = [options.episode]
    known, narrow = published.read(), published.read_narrow()
    if numbers[-1] >= len(known):
        raise InvalidInput(f"the published list has {len(known):,} episodes")
    episodes, lacking = playing.playable_here([drawn(number) for number in numbers])
    if not episodes:
        raise MissingExtra(lacking)
    report_problems([lacking] if lacking else [])
    with shown_progress(len(episodes), "episodes") as show:
        found = playing.trails_of(
            [episode.number for episode in episodes], options.workers, lambda done: show(done, "")
        )
    verdict = verdict_of(found, known, narrow, len(numbers))
    print(*verdict.lines(), sep="\n")
    return DONE if verdict.as_published else FAILED
