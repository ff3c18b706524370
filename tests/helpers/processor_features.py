"""The least x86 processor, without AVX-512 and AVX2, for child processes."""

import os

from numpy._core._multiarray_umath import __cpu_features__

_GROUPS = ("X86_V3", "X86_V4", "AVX512_ICL", "AVX512_SPR")
"""The groups of features beyond NumPy's baseline, named as by NumPy 2.4."""
WIDE = bool(__cpu_features__.get("X86_V4"))
"""Whether this processor has AVX-512, in which NumPy has arctangents of its own."""


def without_avx512(code=None):
    """The environment variables of a child process that computes as that processor does; with a
    folder for `code`, its compiled code, too.
    """
    # The code needs a folder of its own: two processes that write code of two processors into one
    # may overwrite each other's.
    compiled = {"NUMBA_CPU_NAME": "generic", "NUMBA_CACHE_DIR": str(code)}
    present = [name for name in _GROUPS if __cpu_features__.get(name)]
    named = {"NPY_DISABLE_CPU_FEATURES": " ".join(present), "OPENBLAS_CORETYPE": "Nehalem"}
    return os.environ | named | (compiled if code else {})
