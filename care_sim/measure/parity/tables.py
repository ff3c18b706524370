"""The figures of a comparison for people."""

from dataclasses import replace
from typing import Any

from care_sim.measure.parity.verdicts import VERDICTS
from care_sim.reports.table import Table

_COLUMNS = ("against", "rays", "other body", "over 1 mm off", *VERDICTS[1:], "widest gap, m")
_NOTES = (
    "grazing: `fast` answers some rays 1 um aside as the other did; lost: the other answers some "
    "of them as `fast` did; tolerance: Bullet in millimetres sides with `fast`; widest gap: "
    "between ranges to the same body",
)
_PICTURE_COUNTS = {
    "pictures": "pictures",
    "pixels": "pixels that show a body",
    "other_pixels": "another body",
    "boxes": "visible boxes",
    "other_boxes": "another box",
    "widest_px": "widest gap, px",
    "in_one_only": "in one picture only",
}


def parity_tables(report: dict[str, Any]) -> list[Table]:
    """One table for random scenes and for each scenario, one of the pictures and one of the
    outcomes; what was not compared has none.
    """
    # The notes stand below the last table of scans, once for all of them.
    made = [_table(title, figures) for title, figures in report["scans"].items()]
    scans = [*made[:-1], *(replace(last, notes=_NOTES) for last in made[-1:])]
    seen = [_pictures(report["pictures"])] if report["pictures"] else []
    return [
        *scans,
        *seen,
        *([_outcomes(report["outcomes"])] if report["outcomes"]["episodes"] else []),
    ]


def _pictures(pictures: dict[str, Any]) -> Table:
    rows = (
        (name, *(f"{figures[key]:.0f}" for key in _PICTURE_COUNTS))
        for name, figures in pictures.items()
    )
    return Table(
        "Pictures of the camera against Bullet",
        ("scenario", *_PICTURE_COUNTS.values()),
        tuple(rows),
    )


def _table(title: str, figures: dict[str, Any]) -> Table:
    """One reference after the other, what the rays meet line by line."""
    rows: list[tuple[str, ...]] = []
    for reference, met in figures["references"].items():
        rows += [
            (reference,),
            *(_row(group, counts) for group, counts in met.items() if counts["rays"]),
        ]
    return Table(f"{title}: {figures['scans']} scans", _COLUMNS, tuple(rows))


def _row(group: str, counts: dict[str, float]) -> tuple[str, ...]:
    whole = (counts[key] for key in ("rays", "other_ids", "other_ranges", *VERDICTS[1:]))
    return group, *(f"{number:.0f}" for number in whole), f"{counts['widest_m']:.1e}"


def _outcomes(outcomes: dict[str, Any]) -> Table:
    columns = (
        "episodes",
        "another outcome",
        "also than in millimetres",
        "another keyframe",
        "keyframes",
    )
    keys = ("episodes", "other_outcomes", "other_than_exact", "other_keyframes", "keyframes")
    counts = (outcomes[key] for key in keys)
    row = tuple(str(count if isinstance(count, int) else len(count)) for count in counts)
    differing = dict.fromkeys([*outcomes["other_outcomes"], *outcomes["other_keyframes"]])
    return Table(
        "Episodes of the paper's study under both engines", columns, (row,), tuple(differing)
    )
