"""Compiled code where it can be kept, and where it cannot."""

import os
import pty
import select
import subprocess
import sys

NOWHERE = """
import numba.core.caching as caching
caching.CacheImpl._locator_classes = []
from care_sim.core.allocation_kernels import survey
import numpy as np
print(survey(np.array([3, 1]), np.array([2])))
"""


def test_without_a_folder_for_the_code_it_is_compiled_anew():
    done = subprocess.run([sys.executable, "-c", NOWHERE], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "(0, 3, False)"


def test_the_package_alone_compiles_nothing():
    code = "import sys, care_sim; print('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_who_waits_at_a_terminal_for_the_first_use_is_told(tmp_path):
    terminal, other_end = pty.openpty()
    code = (
        "import numpy as np; from care_sim.core.allocation_kernels import survey; survey(np.array([3]), np.array([1]))"
    )
    heard = []
    for _ in range(2):
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
        subprocess.run([sys.executable, "-c", code], env=environment, stderr=other_end, check=True)
        heard.append(os.read(terminal, 1000).decode() if select.select([terminal], [], [], 0)[0] else "")
    assert heard == ["care_sim: compiling; this takes half a minute, once on a machine\r\n", ""]
