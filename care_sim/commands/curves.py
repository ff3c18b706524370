"""`care-sim train curves`: the figure of learning curves."""

from care_sim.base.console import TableConsole
from care_sim.base.errors import InvalidInput, print_lines
from care_sim.base.files import told_if_replaced
from care_sim.commands.options.learning import Curves
from care_sim.reports.figures.files import check_figure, save
from care_sim.training.curves import grouped_runs, read_run
from care_sim.training.curves_figure import curves_figure
from care_sim.training.curves_table import curves_table


def curves(options: Curves) -> int:
    """Draw learning curves, and print their table."""
    if not options.folders:
        raise InvalidInput(
            "curves needs the folder of a training run, the --out of `care-sim train`"
        )
    groups = grouped_runs(map(read_run, options.folders))
    check_figure(options.out)
    table = curves_table(groups)
    told = told_if_replaced(options.out.with_suffix(".png"))
    save(curves_figure(groups), options.out)
    TableConsole().print(table.rich())
    print_lines(f"Figure: {told}")
    return 0
