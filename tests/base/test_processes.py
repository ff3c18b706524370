"""Processes that are started, whatever the folder for temporary files and the current one are."""

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


def test_a_file_of_the_current_folder_is_no_library(tmp_path):
    program = tmp_path / "programs" / "squares.py"
    program.parent.mkdir()
    program.write_text(SQUARES)
    (tmp_path / "highway_env.py").write_text("print('not the library', flush=True)")
    ended = subprocess.run(
        [sys.executable, str(program)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (ended.stdout, ended.stderr) == ("1 2\n", "")
