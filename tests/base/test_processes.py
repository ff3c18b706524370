"""Processes that are started, whatever the folder for temporary files is."""

import os
import subprocess
import sys

SQUARES = """
from care_sim.study.executors import processes

if __name__ == "__main__":
    with processes(1) as pool:
        print(*pool.map(abs, [-1, -2]))
"""


def test_a_long_folder_for_temporary_files_is_none_for_sockets(tmp_path):
    long = tmp_path / ("t" * 80)
    long.mkdir()
    program = tmp_path / "squares.py"
    program.write_text(SQUARES)
    ended = subprocess.run(
        [sys.executable, str(program)],
        env=os.environ | {"TMPDIR": str(long)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ended.stdout, ended.stderr) == ("1 2\n", "")
    assert not [*long.iterdir()]
