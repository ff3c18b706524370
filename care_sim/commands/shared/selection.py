"""Which of the named scenarios and policies a sweep plays."""

from collections.abc import Callable, Collection, Iterable, Sequence

from care_sim.base.errors import BrokenPolicy, MissingExtra

ALL_NAMES = "all"
"""The name that stands for every known one."""


def expanded(names: Sequence[str], known: Collection[str]) -> list[str]:
    """The names, each once; `all` stands for those that are known."""
    return list(
        dict.fromkeys(each for name in names for each in (known if name == ALL_NAMES else [name]))
    )


def made(
    policies: Iterable[str], make: Callable[[str], object]
) -> tuple[list[str], dict[str, str]]:
    """The policies of which `make` can make tasks, and for each of the others the reason why it
    cannot.

    Raises what `make` raises where the policy is not to blame.
    """
    sound = []
    broken = {}
    for policy in policies:
        try:
            make(policy)
            sound.append(policy)
        except (BrokenPolicy, MissingExtra) as error:
            broken[policy] = str(error)
    return sound, broken
