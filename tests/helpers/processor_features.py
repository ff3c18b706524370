"""Environment variables under which numpy, OpenBLAS and numba compute as on a processor of fewer
features.
"""

import os

import numpy as np
import pytest
from numpy._core._multiarray_umath import __cpu_features__

GROUPS = ("X86_V3", "X86_V4", "AVX512_ICL", "AVX512_SPR")
"""numpy's dispatch groups beyond its baseline; of the wide ones it has vectorised arctangents."""


def reduced(code=None):
    """The environment variables of a child process; with a folder for `code`, numba compiles for a
    processor of fewer features too. Skips the test where there is nothing to leave out.
    """
    present = [name for name in GROUPS if __cpu_features__.get(name)]
    if "X86_V4" not in present:
        pytest.skip(f"numpy {np.__version__} finds no AVX-512 here that could be left out")
    compiled = {"NUMBA_CPU_NAME": "generic", "NUMBA_CACHE_DIR": str(code)} if code else {}
    return (
        os.environ
        | compiled
        | {"NPY_DISABLE_CPU_FEATURES": " ".join(present), "OPENBLAS_CORETYPE": "Nehalem"}
    )
