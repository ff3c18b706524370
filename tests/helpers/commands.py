"""The command line, run in this process."""

import pytest

from care_sim.cli import main


def run(capsys, *words):
    """The exit code of `care-sim`, and what it printed and complained of."""
    with pytest.raises(SystemExit) as end:
        main([*map(str, words)])
    return end.value.code, *capsys.readouterr()
