"""`care-sim parity`: compare, print, write."""

import json
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import LARGEST_INTEGER
from care_sim.base.console import TableConsole
from care_sim.base.files import JSON, replacing
from care_sim.measure.parity.figure import parity_figure
from care_sim.measure.parity.keyframes import keyframes
from care_sim.measure.parity.outcomes import outcomes
from care_sim.measure.parity.random_scenes import random_scenes
from care_sim.measure.parity.tables import parity_tables
from care_sim.measure.parity.tally import REFERENCE_NAMES
from care_sim.reports.figures.files import check_beside, save
from care_sim.scenarios import PAPER_SCENARIOS
from care_sim.study.progress import ProgressLines, progress_bar
from care_sim.study.provenance import machine, versions

Figures = TypeVar("Figures")


@dataclass(frozen=True, kw_only=True)
class ParityConfig:
    """Compare the engine `fast` with Bullet: in random scenes, in full scans and pictures of the
    keyframes of every scenario, and in the course of the episodes of the paper's study.
    """

    scenes: int = bounded(100_000, 0, LARGEST_INTEGER)
    """Random scenes."""
    episodes: int = bounded(5, 0, 10_000)
    """Number of seeds, from 0, of every scenario, whose keyframes are all scanned in full, and of
    the paper's study.
    """
    seed: int = bounded(0, 0, LARGEST_INTEGER)
    """Seed of the random scenes."""
    out: Path | None = None
    """File for the counts as JSON; their figure is written beside it as PNG and SVG."""

    def __post_init__(self) -> None:
        check_fields(self)


def run_parity(config: ParityConfig) -> int:
    """Compare, print the tables, write JSON and figure; 0 where the engines agree as `agree` says,
    else 1.
    """
    # Files that cannot be written are refused before anything is compared.
    if config.out is not None:
        check_beside(config.out)
    with nullcontext() if config.out is None else replacing(config.out, JSON) as unfinished:
        report = parity_report(config)
        console = TableConsole()
        for table in parity_tables(report):
            console.print(table.rich())
        if unfinished is not None:
            unfinished.write_text(json.dumps(report, indent=2) + "\n")
    if config.out is not None and report["scans"]:
        save(parity_figure(report), config.out)
    return 0 if agree(report) else 1


def agree(report: dict[str, Any]) -> bool:
    """Whether every difference from Bullet in millimetres has an explanation, visible boxes end
    within a pixel, and episodes end as under Bullet.

    Bullet in its own metres is no judge of rays: its tolerance of 1 mm decides some.
    """
    boxes = max((figures["widest_px"] for figures in report["pictures"].values()), default=0.0)
    return not unexplained(report) and boxes <= 1 and not report["outcomes"]["other_outcomes"]


def parity_report(config: ParityConfig) -> dict[str, Any]:
    """`config`, `machine` and `versions`; `scans`, the figures of random scenes and of every
    scenario of one encounter; `pictures`, those of these scenarios; and `outcomes`, those of whole
    episodes.
    """
    random = _shown("scenes", config.scenes, partial(random_scenes, config.seed))
    played = {
        name: _shown(f"{name} episodes", config.episodes, partial(keyframes, name))
        for name in PAPER_SCENARIOS
    }
    ended = _shown("seeds of the paper's study", config.episodes, outcomes)
    scans = {"random scenes": random, **{name: compared.rays for name, compared in played.items()}}
    pictures = {name: compared.pictures for name, compared in played.items()}
    return {
        "config": {name: value for name, value in asdict(config).items() if name != "out"},
        "machine": machine(),
        "versions": versions(),
        "scans": {name: tally.figures() for name, tally in scans.items() if tally.scans},
        "pictures": {name: seen.figures() for name, seen in pictures.items() if seen.pictures},
        "outcomes": ended.figures(),
    }


def unexplained(report: dict[str, Any]) -> int:
    """How many rays differ from Bullet in millimetres without an explanation."""
    met = (
        figures["references"][REFERENCE_NAMES[-1]].values() for figures in report["scans"].values()
    )
    return sum(counts["unexplained"] for groups in met for counts in groups)


def _shown(
    unit: str, total: int, compare: Callable[[int, Callable[[int], None]], Figures]
) -> Figures:
    with (
        progress_bar(total, unit)
        if sys.stderr.isatty()
        else nullcontext(ProgressLines(total, unit)) as show
    ):
        return compare(total, lambda done: show(done, ""))
