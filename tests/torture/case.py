"""The campaigns, and one case of a campaign: its name, its dice, its folder, its faults."""

import importlib
from pathlib import Path
from random import Random
from typing import NamedTuple

CAMPAIGNS = {
    "commands": 4,
    "calls": 3,
    "files": 3,
    "recordings": 2,
    "studies": 7,
    "folders": 2,
    "surroundings": 5,
}
"""The campaigns by name, and what share of the time each has."""
DONE, REFUSED, INTERRUPTED = "done", "refused", "interrupted"
"""How a case may end well."""
FOUND = "found"
"""In the place of a seed: cases that went wrong once and are kept."""


class Name(NamedTuple):
    """The name of a case; everything in it follows from that."""

    campaign: str
    seed: int | str
    number: int

    def __str__(self):
        return f"{self.campaign}:{self.seed}:{self.number}"

    @classmethod
    def of(cls, text):
        campaign, seed, number = text.split(":")
        return cls(campaign, seed if seed == FOUND else int(seed), int(number))

    @property
    def module(self):
        return importlib.import_module(f"tests.torture.{self.campaign}")


def words(text):
    """A list of words, in one line."""
    return text.split()


def found(campaign):
    """The cases of a campaign that once went wrong."""
    cases = getattr(Name(campaign, FOUND, 0).module, "FOUND_CASES", ())
    return [Name(campaign, FOUND, number) for number in range(len(cases))]


class Fault(Exception):
    """An event that must not happen: of a `kind`, somewhere in the code (`place`), told in
    `detail`.
    """

    def __init__(self, kind, detail="", place=""):
        super().__init__(f"{kind} at {place}: {detail}" if place else f"{kind}: {detail}")
        self.kind, self.detail, self.place = kind, detail, place


class Case:
    """`folder` is empty and all its own, and the working folder. `steps` is a file that tells what
    was done there, also where the process does not live to tell.
    """

    def __init__(self, name, folder=Path(), steps=None):
        self.name, self.folder, self.rng = name, folder, Random(str(name))
        self._steps = steps

    def tell(self, step):
        """Note what comes next, for whoever reads of a fault."""
        try:
            text = str(step)
        except RecursionError:
            text = "what is nested too deep to be told"
        if self._steps:
            self._steps.write(f"{text}\n")
