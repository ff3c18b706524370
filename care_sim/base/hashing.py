"""Chance by hashing: numbers that depend on a key alone, whatever else is drawn."""

import math

import numpy as np

from care_sim.base.compiled import compiled

_30, _27, _31 = np.uint64(30), np.uint64(27), np.uint64(31)
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_GOLDEN, _ONE, _ELEVEN = np.uint64(0x9E3779B97F4A7C15), np.uint64(1), np.uint64(11)


@compiled()
def finalise(number: np.uint64) -> np.uint64:
    """The finaliser of SplitMix64 (Steele, Lea and Flood 2014), which leaves no trace of its
    input.
    """
    number = (number ^ (number >> _30)) * _FIRST
    number = (number ^ (number >> _27)) * _SECOND
    return number ^ (number >> _31)


@compiled()
def mixed(key: np.uint64, number: int) -> np.uint64:
    """The key below a key with a number from 0 up: SplitMix64 at its step `number`."""
    return finalise(key + (np.uint64(number) + _ONE) * _GOLDEN)


@compiled()
def uniform(key: np.uint64, number: int) -> float:
    """Hash a key and a number evenly above 0 and up to 1."""
    return (float(mixed(key, number) >> _ELEVEN) + 0.5) / 2.0**53


@compiled()
def normal(key: np.uint64, number: int) -> float:
    """Hash a key and a number to a standard normal number (Box and Muller 1958), from the uniform
    numbers 2 `number` and 2 `number` + 1.
    """
    radius = math.sqrt(-2 * math.log(uniform(key, 2 * number)))
    return radius * math.cos(2 * math.pi * uniform(key, 2 * number + 1))
