"""What a command has imported when it first prints something: a user waits for all of it."""

import os
import subprocess
import sys

import pytest

SLOW = {"highway_env", "matplotlib", "pandas", "scipy.stats", "torch"}
FIRST = """
import os, sys

class First:
    encoding = "utf-8"

    def write(self, text):
        if text.strip():
            os.write(2, " ".join(sys.modules).encode())
            os._exit(0)

    def flush(self):
        pass

    def isatty(self):
        return False

sys.stdout = sys.stderr = First()
from care_sim.cli import main
main(sys.argv[1:])
"""


@pytest.mark.parametrize("line", ["sweep --seeds 1", "protocol --scenes 1", "report results/dense"])
def test_nothing_slow_that_is_not_needed_yet(line, tmp_path):
    command = [sys.executable, "-c", FIRST, *line.split()]
    ended = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    loaded = {*ended.stderr.split()}
    assert "care_sim" in loaded
    assert loaded & SLOW == set()
