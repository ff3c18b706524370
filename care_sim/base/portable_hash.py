"""Bytes that are equal wherever the same happened, for hashes: numbers that count exactly, measured
ones rounded.

Processors, mathematical libraries and their versions differ in the last bits of sine, arctangent or
a matrix product. What is hashed as raw bits therefore moves with the machine although nothing else
happened.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from care_sim.base.compiled import compiled

STEP = 1e-4
"""Metres, radians, metres per second: what measured numbers are rounded to. A whole episode
computed with other features of the processor moves poses by less than 1e-13, and the float32 ranges
of an observation by their last bit, 4e-6; what an outcome rests on (sizes, margins, the spacing of
rays) is centimetres."""
SHIFT = (5**0.5 - 1) / 2
"""Shares of a step by which the borders between steps lie beside the round numbers that scenes are
made of (0, 0.05, 1.5, a half of anything): a number on a border would be rounded by its last bit.
"""

_INFINITE = 2**62
_NONE = 2**62 + 1
_LARGEST = 2.0**61

Content = str | ArrayLike


def portable_bytes(*parts: Content | tuple[Content, ...]) -> bytes:
    """The bytes of texts, arrays and numbers, and of tuples of them, with their shapes.

    Whole numbers and flags are taken exactly, the others to `STEP`; -0.0 is 0, float32 and float64
    are one, infinities and NaN are numbers of their own.
    """
    return b"".join(map(_bytes_of, parts))


def _bytes_of(part: object) -> bytes:
    # Each part begins with its kind and size, so that no two different sequences of parts are the
    # same bytes: ("ab", "c") is not ("a", "bc").
    if isinstance(part, str):
        text = part.encode(errors="surrogatepass")
        return b"text %d " % len(text) + text
    if isinstance(part, tuple):
        return b"tuple %d " % len(part) + portable_bytes(*part)
    numbers = np.asarray(part)
    whole = numbers if numbers.dtype.kind in "biu" else _rounded(numbers)
    return b"array %r " % (numbers.shape,) + np.ascontiguousarray(whole, "<i8").tobytes()


def _rounded(numbers: NDArray[np.floating]) -> NDArray[np.int64]:
    """The step that each number lies in."""
    # Compiled for the two kinds of floats that arrays come in; any other is taken as the wider one.
    is_single = numbers.dtype == np.float32
    table: NDArray[np.floating] = np.ascontiguousarray(
        numbers, np.float32 if is_single else np.float64
    )
    return np.asarray(_steps(table.reshape(-1)).reshape(numbers.shape))


@compiled()
def _steps(numbers: NDArray[np.floating]) -> NDArray[np.int64]:
    """(n,) the steps of numbers (n,)."""
    steps = np.empty(len(numbers), np.int64)
    for n in range(len(numbers)):
        number = np.float64(numbers[n])
        # Floor, not round: a border lies SHIFT beside each multiple of the step. Held in bounds,
        # so that every step is a 64-bit integer, and those beyond are left for infinity and NaN.
        if math.isfinite(number):
            step = math.floor(min(max(number / STEP + SHIFT, -_LARGEST), _LARGEST))
        elif math.isnan(number):
            step = _NONE
        else:
            step = _INFINITE if number > 0 else -_INFINITE
        steps[n] = step
    return steps
