"""A processor without AVX-512, for child processes."""

import os

from numpy._core._multiarray_umath import __cpu_features__

_GROUPS = ("X86_V4", "AVX512_ICL", "AVX512_SPR")
"""The groups of features, named as by NumPy 2.4, in which it has arctangents of its own."""
WIDE = bool(__cpu_features__.get("X86_V4"))
"""Whether this processor has AVX-512."""


def without_avx512(code=None):
    """The environment variables of a child process that computes as a processor without AVX-512
    does; with a folder for `code`, its compiled code, too.
    """
    # The code needs a folder of its own: two processes that write code of two processors into one
    # may overwrite each other's.
    compiled = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(code)}
    present = [name for name in _GROUPS if __cpu_features__.get(name)]
    named = {"NPY_DISABLE_CPU_FEATURES": " ".join(present), "OPENBLAS_CORETYPE": "Haswell"}
    return os.environ | named | (compiled if code else {})
