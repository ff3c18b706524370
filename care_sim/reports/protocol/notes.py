"""The notes under the protocol's tables: how much was played, and what is missing."""

from collections.abc import Collection, Iterable, Iterator, Sequence

from care_sim.base.errors import counted, percent
from care_sim.evaluation.recall import Tally
from care_sim.evaluation.sightings import ANNOTATED, VISIBLE
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.study.run_config import FULL, Row

UNITS_OF_DIFFERENCES = "Recall in points; TTFD in keyframes, less is better."


def played(plays: SettingPlays) -> str:
    """Scenes, events, object frames and floor seeds."""
    total = _counts(plays.scenes.values())
    # The most that any policy has at a budget: some may have been played with fewer.
    seeds = {
        len(plays.seeds(policy, budget)) for policy in plays.policies for budget in plays.budgets
    }
    kinds = ", ".join(f"{count:,.0f} {kind}" for kind, count in plays.newcomers.items())
    return (
        f"{counted(len(plays.scenes), 'scene')}, {total.events:,.0f} events"
        f"{f' ({kinds})' if kinds else ''}, {total.frames:,.0f} "
        f"object frames; {counted(max(seeds, default=0), 'floor seed')}."
    )


def _by_both_counts(scenes: Collection[Row]) -> str:
    """How many events there are by the other presence, given one row of every scene; nothing where
    rows do not tell.
    """
    # Rows of earlier versions lack the column.
    if any(row.get("emerging") is None for row in scenes):
        return ""
    emerging = sum(row["emerging"] for row in scenes)
    if any(row.get("presence") == VISIBLE for row in scenes):
        return f" Presence {ANNOTATED} does not count {emerging:,} of them."
    every = _counts(scenes).events + emerging
    return f" Presence {VISIBLE} counts {counted(emerging, 'more event')}, {every:,.0f} in all."


def _counts(scenes: Iterable[Row]) -> Tally:
    """Events and object frames, given one row of every scene."""
    return sum((Tally(events=row["events"], frames=row["frames"]) for row in scenes), Tally())


def of_full(plays: SettingPlays) -> tuple[str, ...]:
    """A note where there is no share of the full scan's recall."""
    return () if plays.full else ("Of full: the full scan was not played.",)


def left_out(plays: SettingPlays) -> tuple[str, ...]:
    """How many scenes lack a play of a policy; they are left out of its levels and contrasts."""
    missing = "; ".join(_missing(plays))
    return (f"Scenes without a play, left out: {missing}.",) if missing else ()


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


def protocol_closing(rows: Sequence[Row]) -> list[str]:
    """The size of the study."""
    # Events and object frames belong to the film: one row of a scene is enough.
    scenes = {(row["source"], row["scene"]): row for row in rows}
    total = _counts(scenes.values())
    keyframes = sum(row["keyframes"] for row in scenes.values())
    return [
        f"Scenes: {len(scenes):,}, with {total.events:,.0f} first sightings and "
        f"{total.frames:,.0f} object frames in {keyframes:,} keyframes; plays: "
        f"{len(rows):,}.{_by_both_counts(scenes.values())}"
    ]
