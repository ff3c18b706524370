"""One case of a campaign: its name, its dice, its folder, and what was done in it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import NamedTuple

DONE, REFUSED, INTERRUPTED = "done", "refused", "interrupted"
"""How a case may end well."""

FOUND = "found"
"""In the place of a seed: cases that went wrong once and are kept."""


class Name(NamedTuple):
    """What a case is called; everything in it follows from that."""

    campaign: str
    seed: int | str
    number: int

    def __str__(self):
        return f"{self.campaign}:{self.seed}:{self.number}"

    @classmethod
    def of(cls, text):
        campaign, seed, number = text.split(":")
        return cls(campaign, seed if seed == FOUND else int(seed), int(number))


class Fault(Exception):
    """What must not happen: of a `kind`, somewhere in the code (`place`), told in `detail`."""

    def __init__(self, kind, detail="", place=""):
        super().__init__(f"{kind} at {place}: {detail}" if place else f"{kind}: {detail}")
        self.kind, self.detail, self.place = kind, detail, place


@dataclass
class Case:
    """`folder` is empty and all its own, and the working folder; what is done there is told in
    `steps`, and to `listener`, who hears it even where the process does not live to tell.
    """

    name: Name
    folder: Path
    listener: Callable[[str], object] = str
    steps: list[str] = field(default_factory=list)

    def __post_init__(self):
        self.rng = Random(str(self.name))

    def tell(self, step):
        """Note what comes next, for whoever reads of a fault."""
        try:
            text = str(step)
        except RecursionError:
            text = "what is nested too deep to be told"
        self.steps.append(text)
        self.listener(f"{text}\n")
