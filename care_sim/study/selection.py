"""Which of the named scenarios and policies a sweep plays."""

from collections.abc import Collection, Iterable, Sequence
from typing import Any

from care_sim.errors import BrokenPolicy, MissingExtra
from care_sim.study.config import grid

ALL = "all"
"""Stands for every known name."""


def expanded(names: Sequence[str], known: Collection[str]) -> list[str]:
    """The names, each once; all that are known where `all` is among them."""
    return list(dict.fromkeys(known if ALL in names else names))


def playable(
    policies: Iterable[str], scenarios: Sequence[str], budget: float, **common: Any
) -> tuple[list[str], dict[str, str]]:
    """The policies that can be made in all scenarios, and for each of the others the reason why it cannot.

    `common` are further fields of `care_sim.study.config.EpisodeConfig`. Raises InvalidInput where a field is wrong.
    """
    made, broken = [], {}
    for policy in policies:
        try:
            grid(scenarios, [policy], [budget], [0], **common)
            made.append(policy)
        except (BrokenPolicy, MissingExtra) as error:
            broken[policy] = str(error)
    return made, broken
