"""`care-sim bench`: measure, print, write."""

import json
import sys
from contextlib import nullcontext
from functools import partial

from rich.console import Console

from care_sim.base.files import JSON, replacing
from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.figure import growth_figure
from care_sim.measure.bench.measure import measure
from care_sim.measure.bench.tables import bench_tables
from care_sim.reports.figures.files import check_figure, save


def run_bench(config: BenchConfig) -> int:
    """Measure, print the tables, write JSON and figure; 0 whether or not the targets are met."""
    if config.out is not None:
        check_figure(config.out)
    with nullcontext() if config.out is None else replacing(config.out, JSON) as unfinished:
        report = measure(config, partial(print, "measuring", file=sys.stderr))
        console = Console(highlight=False)
        for table in bench_tables(report):
            console.print(table.rich())
        if unfinished is not None:
            unfinished.write_text(json.dumps(report, indent=2) + "\n")
    if config.out is not None:
        save(growth_figure(report), config.out)
    return 0
