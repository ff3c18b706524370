"""A campaign that goes wrong on purpose, in as many ways as it has cases: the field has to see
each.
"""

import os
import signal

LIMIT_S = 0.5


def play(case):
    WAYS[case.name.number](case)


def hang(_case):
    while True:
        pass


def too_much_memory(_case):
    bytearray(2**31)


def death(_case):
    os.kill(os.getpid(), signal.SIGKILL)


def exception(_case):
    raise KeyError(5)


WAYS = (hang, too_much_memory, death, exception)
KINDS = ("hang", "MemoryError in the campaign", "memory above 1 GB", "KeyError in the campaign")
