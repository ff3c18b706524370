"""Policies of installed packages, found through the entry-point group `care_sim.policies`.

The entry's name is the policy's, its object a `Policy` subclass or another callable that takes a
`Rig` and parameters. Of two entries with one name the first on the path counts, as for modules.
"""

import inspect
from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from care_sim.base.errors import InvalidInput
from care_sim.policies.base import TAGS, Policy
from care_sim.policies.parameters import PolicyMaker

ENTRY_POINTS = "care_sim.policies"


def all_entries() -> list[EntryPoint]:
    """Every entry, in order of name."""
    return sorted(entry_points(group=ENTRY_POINTS), key=lambda entry: entry.name)


def entries() -> dict[str, EntryPoint]:
    """The entry that counts, by name."""
    return {entry.name: entry for entry in reversed(all_entries())}


def load(entry: EntryPoint) -> PolicyMaker:
    """What makes the policy. Raises InvalidInput with the reason when there is no using it."""
    try:
        made = entry.load()
    except (Exception, SystemExit) as error:
        raise InvalidInput(f"{type(error).__name__}: {' '.join(str(error).split())}") from error
    for fault in _faults(made):
        raise InvalidInput(f"{entry.value} {fault}")
    make: PolicyMaker = made
    return make


def package_of(entry: EntryPoint) -> str:
    """The distribution with its version, or the module of an entry that belongs to none."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.module


def _faults(made: Any) -> Iterator[str]:
    if not callable(made) or (inspect.isclass(made) and not issubclass(made, Policy)):
        yield "is no Policy"
    if inspect.isabstract(made):
        yield f"is abstract: it lacks {', '.join(sorted(made.__abstractmethods__))}"
    try:
        inspect.signature(made)
    except (TypeError, ValueError):
        yield "tells no parameters"
    tags = getattr(made, "tags", TAGS)
    source = getattr(made, "source", "")
    if not (isinstance(tags, tuple) and tags and all(tag in TAGS for tag in tags)):
        yield f"has tags {tags!r}; allowed is a tuple of {', '.join(TAGS)}"
    if not isinstance(source, str):
        yield f"has the source {source!r}; allowed is one line of text"
