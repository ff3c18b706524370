"""Environment variables under which numpy, glibc and OpenBLAS compute as on a processor of fewer features."""

import os

import numpy as np
import pytest
from numpy._core._multiarray_umath import __cpu_features__

GROUPS = ("X86_V3", "X86_V4", "AVX512_ICL", "AVX512_SPR")
"""numpy's dispatch groups beyond its baseline; of the wide ones it has vectorised arctangents."""


def reduced():
    """What a child process is given. Skips the test where there is nothing to leave out."""
    present = [name for name in GROUPS if __cpu_features__.get(name)]
    if "X86_V4" not in present:
        pytest.skip(f"numpy {np.__version__} finds no AVX-512 here that could be left out")
    return os.environ | {"NPY_DISABLE_CPU_FEATURES": " ".join(present), "OPENBLAS_CORETYPE": "Nehalem"}
