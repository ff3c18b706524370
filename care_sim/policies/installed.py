"""What an entry of the group `care_sim.policies` must be: a `Policy` subclass, or another callable
that takes a `Rig` and parameters.
"""

import inspect
from collections.abc import Iterator
from typing import Any

from care_sim.policies.base import TAGS, Policy


def policy_faults(made: Any) -> Iterator[str]:
    """In which ways a loaded object makes no policy, as `care_sim.base.plugins.Plugins` asks."""
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
