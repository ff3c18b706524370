"""The console that prints tables."""

from rich.console import Console


class TableConsole(Console):
    """Standard output, as wide as the terminal, and 80 columns where there is no terminal."""

    def __init__(self) -> None:
        super().__init__(highlight=False)

    def on_broken_pipe(self) -> None:
        """Raise the BrokenPipeError that rich has caught. Rich exits with 1 here, and
        `care_sim.cli` has an exit code for output that nobody reads.
        """
        # Rich calls this method while it handles the error.
        raise
