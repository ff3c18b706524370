"""The policies that a car can have at one budget in one setting, and what is said of them."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from care_sim.reports.controls import best_control, is_control
from care_sim.reports.formatting import MARKS, ShownDifference, interval
from care_sim.study.run_config import FULL

Tags = Mapping[str, tuple[str, ...]]
"""The tags of every policy."""
_MOST_NAMED = 4
"""So many policies are named in a row; of more, how many they are."""


class Verb(NamedTuple):
    """What the first of a contest does, or the first of several, or all alike."""

    one: str
    several: str
    all: str


@dataclass(frozen=True)
class Contest:
    """The policies that a car can have, controls too, at one budget in one setting, over what all
    of them have played.

    `levels` are means, the highest the best; `told` says one in words. `difference` holds two
    against each other, and counts from `gate` on, both in `unit`.
    """

    place: str
    verb: Verb
    unit: str
    gate: float
    tags: Tags
    levels: Mapping[str, float]
    told: Callable[[str], str]
    difference: Callable[[str, str], ShownDifference | None]

    def findings(self) -> Iterator[str]:
        """One sentence, or none where there is nobody to compare."""
        others = [policy for policy in self.levels if not is_control(self.tags[policy])]
        controls = [policy for policy in self.levels if policy not in others]
        if not others or len(self.levels) < 2:
            return
        first = max(self.levels, key=self.levels.__getitem__)
        over = {policy: self.difference(first, policy) for policy in self.levels if policy != first}
        tied = [first, *(policy for policy, each in over.items() if _is_nothing(each))]
        if len(tied) == len(self.levels):
            with_controls = ", controls included" if controls else ""
            yield (
                f"{self.place}: all {len(tied)} policies {self.verb.all}, "
                f"{self.told(first)}{with_controls}."
            )
            return
        alike = [p for p, each in over.items() if p not in tied and not _is_ahead(each)]
        close = [p for p, each in over.items() if _is_ahead(each) and self._is_little(each)]
        leads = self.verb.one if len(tied) == 1 else self.verb.several
        control = best_control({policy: self.levels[policy] for policy in controls})
        # Beside a control that difference is the one to know.
        behind = [p for p in over if p not in (*tied, *alike, *close)] if control is None else []
        ahead = ""
        if behind:
            second = max(behind, key=self.levels.__getitem__)
            ahead = f", ahead of {second} ({interval(over[second])}, {self.unit})"
        parts = [f"{self.place}: {_names(tied)} {leads}, {self.told(first)}{ahead}"]
        if alike:
            them = "it" if len(tied) == 1 else "them"
            parts.append(f"{_names(alike)} cannot be told from {them}")
        if close:
            verb = "is" if len(close) == 1 else "are"
            parts.append(f"{_names(close)} {verb} behind{self._by_little()}")
        if control is not None:
            best = max(others, key=self.levels.__getitem__)
            parts.append(self._beside_control(best, control))
        yield f"{'; '.join(parts)}."

    def _beside_control(self, best: str, control: str) -> str:
        """How the best of the others stands to the best control."""
        difference = self.difference(best, control)
        if _is_nothing(difference):
            return f"the best control, {control}, does exactly as well as {best}"
        measured = f"({interval(difference)}, {self.unit})"
        if difference is None or not difference.excludes_zero:
            why = ", for some are never detected" if difference and difference.bound else ""
            return f"{best} and the best control, {control}, cannot be told apart{why} {measured}"
        little = f",{self._by_little()}" if self._is_little(difference) else ""
        if difference.mean > 0:
            return f"{best} is ahead of the best control, {control}{little} {measured}"
        return f"the best control, {control}, is ahead of {best}{little} {measured}"

    def _by_little(self) -> str:
        return f" by less than the gate of {self.gate:g} {self.unit}"

    def _is_little(self, difference: ShownDifference | None) -> bool:
        """Whether a mean difference is below the gate; not where a bound alone is known of it."""
        return difference is not None and not difference.bound and abs(difference.mean) < self.gate


def is_real(policy: str, tags: Tags) -> bool:
    """Whether a car can have the policy at a budget."""
    return policy != FULL and {*MARKS}.isdisjoint(tags[policy])


def told(contests: Iterable[Contest]) -> list[str]:
    """What is said of all of them, and among whom they choose; nothing where nothing is said."""
    said = [(contest, sentence) for contest in contests for sentence in contest.findings()]
    if not said:
        return []
    tags = {policy: contest.tags[policy] for contest, _ in said for policy in contest.levels}
    controls = any(map(is_control, tags.values()))
    chosen = "Who is first, and the best control, are" if controls else "Who is first is"
    return [
        *(sentence for _, sentence in said),
        f"Compared are the {len(tags)} policies played here"
        f"{'' if controls else ', no control among them'}.",
        f"{chosen} chosen at each budget by the very results that are compared, which favours "
        "whoever is chosen; the number of comparisons is not corrected for.",
    ]


def _is_nothing(difference: ShownDifference | None) -> bool:
    """Whether two are the same in everything that was played; not known of the never detected."""
    if difference is None or difference.interval is None:
        return False
    return not any(difference.interval) and not difference.bound


def _is_ahead(difference: ShownDifference | None) -> bool:
    """Whether the first is surely above the other."""
    return difference is not None and difference.excludes_zero and difference.mean > 0


def _names(policies: Sequence[str]) -> str:
    if len(policies) > _MOST_NAMED:
        return f"{', '.join(policies[:_MOST_NAMED])} and {len(policies) - _MOST_NAMED} more"
    return " and ".join(filter(None, [", ".join(policies[:-1]), policies[-1]]))
