"""Values that nobody asked for: what a person may type, paste or compute by mistake, or to do harm."""

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np

HUGE = 10**22
NUMBERS = (
    "0", "-0", "1", "-1", "2", "0.5", "1.0", "1e-9", "-0.5", "1e9", "1e300", "-1e300", "1e308", "5e-324", "1e999",
    "nan", "inf", "-inf", "NaN", "2147483647", "2147483648", "9223372036854775807", "9223372036854775808",
    "18446744073709551616", "9999999999999999999999", str(10**400), "1_000", "0x10", "1e5", "٣", "1,5", "True",
)  # fmt: skip
TEXTS = (
    "", " ", "\n", "a\nb", "\t", "-", "--", "-1", "None", "True", "x", "ü", "日本", "\udcff", "a\udc80b",
    "\x1b[31mred\x1b[0m", "\x07",
    "\x00", "a\x00b", "x" * 5000, "%s", "{}", "{0}", "$x_1$", "$\\frac$", "<script>alert(1)</script>", "'", '"',
    "a b", "a/b", "../up", ".", "..", "=", "a=", "=1", "a=b=c", "[]", "()", "{}", "care", "care.", ".care", "\u202e",
    "|",
)  # fmt: skip
LITERALS = (
    "[1]", "[[1]]", "{[1]}", "{1: 2}", "{1}", "(1,)", "(1, 2)", "(2, 1)", "(nan, nan)", "(1e300, 1e300)", "(0, 0)",
    "(1, 2, 3)", "(-1, 1)", "('a', 'b')", "b'x'", "1j", "...", "None", "True", "'text'", "[None]", "[1, 'a', None]",
    "1" * 5000, "-" * 5000 + "1", "(" * 200 + ")" * 200, "[" * 5000 + "]" * 5000, "'" + "x" * 5000 + "'", "'\\ud800'",
    "'\\x00'", "{'a': {'b': [1]}}", "1e400", "-1e400", "0.1", "5", "1 + 1", "__import__('os')", "lambda: 0", "f'{1}'",
    "[1] * 3", "not 1", "'$x$'", "((1, 2), (3, 4))", "set()", "10**10", "'\\x1b[31m'",
)  # fmt: skip


class Odd:
    """An object of a class that nobody has heard of."""


def objects(rng):
    """A value for an argument of a call; made anew, since some are used up."""
    return rng.choice(_MAKERS)()


_MAKERS = (
    lambda: None, lambda: True, lambda: False, lambda: 0, lambda: 1, lambda: -1, lambda: 2, lambda: 0.5, lambda: 1.5,
    lambda: -0.0, lambda: 1e300, lambda: -1e300, lambda: 1e19, lambda: 5e-324, lambda: math.nan, lambda: math.inf,
    lambda: -math.inf, lambda: 2**31, lambda: 2**63, lambda: HUGE, lambda: 10**400, lambda: -(10**400),
    lambda: Fraction(1, 3), lambda: Decimal("0.1"), lambda: 1j, lambda: np.float32(0.1), lambda: np.int8(-1),
    lambda: np.uint64(2**63), lambda: np.bool_(True), lambda: np.array(0.1), lambda: np.array([0.1]), lambda: np.nan,
    lambda: np.datetime64("now"), lambda: "", lambda: "x", lambda: "care", lambda: "0.1", lambda: "\x00",
    lambda: "\ud800", lambda: "\x1b[31m", lambda: "$x$", lambda: "x" * 5000, lambda: b"x", lambda: bytearray(b"x"),
    lambda: memoryview(b"abc"), list, lambda: [1], lambda: [1.0, 2.0], lambda: (), lambda: (1, 2), lambda: (2, 1),
    lambda: (1e300, 1e300), lambda: (math.nan, math.nan), lambda: [[1], [1, 2]], lambda: [None], lambda: ["a"],
    dict, lambda: {"a": 1}, lambda: {1: 2}, lambda: set(), lambda: {1, 2}, lambda: range(3), lambda: range(10**12),
    lambda: iter([1]), lambda: (n for n in (1, 2)), lambda: object(), lambda: Odd(), lambda: Odd, lambda: len,
    lambda: (lambda: 0), lambda: slice(1), lambda: Ellipsis, lambda: NotImplemented, lambda: np.zeros((32, 512)),
    lambda: np.zeros((0, 7)), lambda: np.zeros((3, 2)), lambda: np.full((2, 7), np.nan), lambda: np.full((2, 13), 1e30),
    lambda: np.zeros(5, complex), lambda: np.array(["a"]), lambda: np.array([None]), lambda: np.array([[1, 2]], object),
    lambda: np.arange(3), lambda: np.array([-1]), lambda: np.array([2**62]), lambda: np.ones(3, bool),
    lambda: np.zeros((1, 2, 3, 4)), lambda: np.zeros(0), lambda: [np.zeros(2), np.zeros(3)], lambda: _nested(3000),
    lambda: np.ma.masked_array([1, 2], [True, False]), lambda: np.zeros(3, dtype=[("a", int)]),
    lambda: Exception("x"), lambda: np.random.default_rng(0), lambda: float, lambda: {"ranges": 1}, lambda: frozenset(),
)  # fmt: skip


def _nested(depth):
    value = []
    for _ in range(depth):
        value = [value]
    return value
