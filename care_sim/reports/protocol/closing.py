"""The sentence after the protocol's tables: how much was played."""

from collections.abc import Sequence

from care_sim.reports.protocol.notes import by_both_counts, counts
from care_sim.study.run_config import Row


def protocol_closing(rows: Sequence[Row]) -> list[str]:
    """The size of the study."""
    # Events and object frames belong to the film: one row of a scene is enough.
    scenes = {(row["source"], row["scene"]): row for row in rows}
    total = counts(scenes.values())
    keyframes = sum(row["keyframes"] for row in scenes.values())
    return [
        f"Scenes: {len(scenes):,}, with {total.events:,.0f} first sightings and "
        f"{total.frames:,.0f} object frames in {keyframes:,} keyframes; plays: "
        f"{len(rows):,}.{by_both_counts(scenes.values())}"
    ]
