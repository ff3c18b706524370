"""Values that nobody asked for: typed, pasted or computed by mistake, or to do harm."""

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np

from tests.torture.case import words

NUMBERS = [
    *words("0 -0 1 -1 2 0.5 1.0 1e-9 -0.5 1e9 1e300 -1e300 1e308 5e-324 1e999 nan inf -inf NaN"),
    *words("2147483647 2147483648 9223372036854775807 9223372036854775808 18446744073709551616"),
    *words("9999999999999999999999 1_000 0x10 1e5 ٣ 1,5 True"),
    str(10**400),
]
TEXTS = [
    *words("- -- -1 None True x ü 日本 %s {} {0} $x_1$ $\\frac$ <script>alert(1)</script> ' \""),
    *words("a/b ../up . .. = a= =1 a=b=c [] () care care. .care \u202e |"),
    *("", " ", "\n", "a\nb", "\t", "a b", "\udcff", "a\udc80b", "\x1b[31mred\x1b[0m", "\x07"),
    *("\x00", "a\x00b", "x" * 5000),
]
LITERALS = [
    *words("[1] [[1]] {[1]} {1} (1,) b'x' 1j ... None True 'text' [None] 1e400 -1e400 0.1 5"),
    *words("set() 10**10 f'{1}' '$x$' '\\ud800' '\\x00' '\\x1b[31m' __import__('os')"),
    *("{1: 2}", "(1, 2)", "(2, 1)", "(nan, nan)", "(1e300, 1e300)", "(0, 0)", "(1, 2, 3)"),
    *("(-1, 1)", "('a', 'b')", "[1, 'a', None]", "{'a': {'b': [1]}}", "1 + 1", "lambda: 0"),
    *("[1] * 3", "not 1", "((1, 2), (3, 4))", "1" * 5000, "-" * 5000 + "1"),
    *("(" * 200 + ")" * 200, "[" * 5000 + "]" * 5000, "'" + "x" * 5000 + "'"),
]
"""Python's own and what looks like it, for parameters of a command line."""


class Odd:
    """An object of a class that nobody has heard of."""


def nested(depth):
    value = []
    for _ in range(depth):
        value = [value]
    return value


_EXPRESSIONS = """
None; True; False; 0; 1; -1; 2; 0.5; 1.5; -0.0; 1e300; -1e300; 1e19; 5e-324; math.nan; math.inf;
-math.inf; 2**31; 2**63; 10**22; 10**400; -(10**400); Fraction(1, 3); Decimal("0.1"); 1j;
np.float32(0.1); np.int8(-1); np.uint64(2**63); np.bool_(True); np.array(0.1); np.array([0.1]);
np.datetime64("now"); ""; "x"; "care"; "0.1"; "\\0"; "\\ud800"; "\\x1b[31m"; "$x$"; "x" * 5000;
b"x"; bytearray(b"x"); memoryview(b"abc"); []; [1]; [1.0, 2.0]; (); (1, 2); (2, 1); (1e300, 1e300);
(math.nan, math.nan); [[1], [1, 2]]; [None]; ["a"]; {}; {"a": 1}; {1: 2}; set(); {1, 2}; range(3);
range(10**12); iter([1]); (n for n in (1, 2)); object(); Odd(); Odd; len; lambda: 0; slice(1); ...;
NotImplemented; np.zeros((32, 512)); np.zeros((0, 7)); np.zeros((3, 2)); np.full((2, 7), np.nan);
np.full((2, 13), 1e30); np.zeros(5, complex); np.array(["a"]); np.array([None]); np.arange(3);
np.array([[1, 2]], object); np.array([-1]); np.array([2**62]); np.ones(3, bool); np.zeros(0);
np.zeros((1, 2, 3, 4)); [np.zeros(2), np.zeros(3)]; nested(3000); np.zeros(3, [("a", int)]);
np.ma.masked_array([1, 2], [True, False]); Exception("x"); np.random.default_rng(0); float;
{"ranges": 1}; frozenset()
"""
_CODES = [compile(text.strip(), "<hostile>", "eval") for text in _EXPRESSIONS.split(";")]
_NAMES = {"math": math, "np": np, "Fraction": Fraction, "Decimal": Decimal, "Odd": Odd}


def objects(rng):
    """A value for an argument of a call; made anew, since some are used up."""
    return eval(rng.choice(_CODES), _NAMES | {"nested": nested})
