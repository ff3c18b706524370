"""What stands under the protocol's tables: how much was played, what is missing, where the paper's
numbers stand.
"""

from collections.abc import Collection, Iterable, Iterator

from care_sim.base.errors import counted, percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.recall import Tally
from care_sim.evaluation.sightings import ANNOTATED, VISIBLE
from care_sim.reports.protocol.differences import OVER_EVENTS, MeasuredDifference
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.study.run_config import FULL, Row

UNITS_OF_DIFFERENCES = "Recall in points; TTFD in keyframes, where less is better."
BY_EVENTS = (
    f"{OVER_EVENTS}: fewer than {FEWEST_PAIRS} scenes have events and plays of both policies, too "
    "few for an interval over scenes. This one comes from resampling events, paired and averaged "
    "over floor seeds; events of one scene are not independent, so it is too narrow, and it speaks "
    "for these drives alone."
)
NO_INTERVAL = (
    f"Without an interval: fewer than {FEWEST_PAIRS} scenes, in a measure for which events are not "
    "resampled (overall recall, strata, equal scene weights, thirds) or with fewer than "
    f"{FEWEST_PAIRS} events."
)

_OF_FULL = (
    "Of full: recall in % of the full scan's, with its interval, over the scenes that both have. "
    "Scenes are resampled with what both found in them; no interval where the full scan finds "
    f"anything in fewer than {FEWEST_PAIRS}."
)


def played(plays: SettingPlays) -> str:
    """Scenes, events, object frames and floor seeds."""
    total = counts(plays.scenes.values())
    # The most that any policy has at a budget: some may have been played with fewer.
    seeds = {
        len(plays.seeds(policy, budget)) for policy in plays.policies for budget in plays.budgets
    }
    kinds = ", ".join(f"{count:,.0f} {kind}" for kind, count in plays.newcomers.items())
    return (
        f"{counted(len(plays.scenes), 'scene')}, {total.events:,.0f} events"
        f"{f' ({kinds})' if kinds else ''}, {total.frames:,.0f} "
        f"object frames; {counted(max(seeds, default=0), 'floor seed')}, averaged per "
        f"scene.{by_both_counts(plays.scenes.values())}"
    )


def by_both_counts(scenes: Collection[Row]) -> str:
    """How many events there are by the other presence, given one row of every scene; nothing where
    rows do not tell.
    """
    # Rows of earlier versions lack the column.
    if any(row.get("emerging") is None for row in scenes):
        return ""
    emerging = sum(row["emerging"] for row in scenes)
    if any(row.get("presence") == VISIBLE for row in scenes):
        return (
            f" Of the events, {emerging:,} are of objects that were hidden within range at scene "
            f"start, which presence {ANNOTATED} does not count."
        )
    return (
        f" {counted(emerging, 'object')} hidden within range at scene start "
        f"{'is' if emerging == 1 else 'are'} no event; presence {VISIBLE} counts them too, "
        f"{counts(scenes).events + emerging:,.0f} in all."
    )


def counts(scenes: Iterable[Row]) -> Tally:
    """Events and object frames, given one row of every scene."""
    return sum((Tally(events=row["events"], frames=row["frames"]) for row in scenes), Tally())


def on_intervals(differences: Iterable[MeasuredDifference | None]) -> tuple[str, ...]:
    """What to know of the intervals of the differences shown: which are over events, and why some
    have none.
    """
    # Each remark stands only under a table that shows such a difference.
    shown = [difference for difference in differences if difference]
    by_events = (BY_EVENTS,) if any(difference.over_events for difference in shown) else ()
    return (
        (*by_events, NO_INTERVAL)
        if any(difference.interval is None for difference in shown)
        else by_events
    )


def of_full(plays: SettingPlays) -> str:
    """What the share of the full scan's recall is, or that there is none."""
    return _OF_FULL if plays.full else "Of full: the full scan was not played."


def left_out(plays: SettingPlays) -> tuple[str, ...]:
    """How many scenes lack a play of a policy; they are left out of its levels and contrasts."""
    missing = list(_missing(plays))
    if not missing:
        return ()
    return (
        f"Left out where a play is missing, of {counted(len(plays.scenes), 'scene')}: "
        f"{'; '.join(missing)}.",
    )


def papers(sources: Iterable[str]) -> tuple[str, ...]:
    """The paper's sentences, each once."""
    # A dict keeps the order in which the table meets the sentences.
    return tuple(f'Paper: "{source}"' for source in dict.fromkeys(sources))


def _missing(plays: SettingPlays) -> Iterator[str]:
    for policy in plays.policies:
        lacking = {
            budget: len(plays.scenes) - len(plays.tallies(policy, budget))
            for budget in plays.budgets
        }
        listed = [f"{count} at {percent(budget)}" for budget, count in lacking.items() if count]
        if listed:
            yield f"{policy} {', '.join(listed)}"
    if plays.full and (count := len(plays.scenes) - len(plays.tallies(FULL, 1.0))):
        yield f"{FULL} {count}"
