"""Compiled code where it can be kept, and where it cannot."""

import subprocess
import sys

NOWHERE = """
import numba.core.caching as caching
caching.CacheImpl._locator_classes = []
from care_sim.turns import survey
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
