"""`care-sim bench`: measure, print, write."""

import json

from rich.console import Console

from care_sim.bench.config import BenchConfig
from care_sim.bench.figure import growth_figure
from care_sim.bench.measure import measure
from care_sim.bench.tables import tables
from care_sim.study.figures import save


def run(config: BenchConfig) -> int:
    """Measure, print the tables, write JSON and figure; 0 whether or not the targets are met."""
    if config.out is not None:
        config.out.parent.mkdir(parents=True, exist_ok=True)
        config.out.touch()
    report = measure(config)
    console = Console(highlight=False)
    for table in tables(report):
        console.print(table.rich())
    if config.out is not None:
        config.out.write_text(json.dumps(report, indent=2) + "\n")
        save(growth_figure(report), config.out)
    return 0
