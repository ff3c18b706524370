"""The policies that a car can have at one budget in one setting, and what is said of them; of all
budgets of a setting, how the best of them stands to the best control.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from care_sim.base.errors import percent
from care_sim.reports.controls import best_control, is_control
from care_sim.reports.formatting import MARKS, ShownDifference, interval
from care_sim.study.run_config import FULL

Tags = Mapping[str, tuple[str, ...]]
"""The tags of every policy."""
_MOST_NAMED = 4
"""So many policies are named in a row; of more, how many they are."""


_STANDINGS = {
    "ahead": "ahead",
    "alike": "the same in every world",
    "untold": "not to be told apart",
    "behind": "behind",
}
"""How the best other policy may stand to the best control, in the order in which it is told."""


class Subject(NamedTuple):
    """What is compared, and the verb for it of the first, or the first of several, or all alike."""

    name: str
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

    setting: str
    budget: float
    subject: Subject
    unit: str
    gate: float
    tags: Tags
    levels: Mapping[str, float]
    told: Callable[[str], str]
    difference: Callable[[str, str], ShownDifference | None]

    @property
    def place(self) -> str:
        """Setting and budget in words."""
        return f"{self.setting}, {percent(self.budget)}"

    @property
    def best(self) -> str | None:
        """The best that is no control."""
        others = [policy for policy in self.levels if not is_control(self.tags[policy])]
        return max(others, key=self.levels.__getitem__, default=None)

    @property
    def control(self) -> str | None:
        """The best control."""
        return best_control({p: at for p, at in self.levels.items() if is_control(self.tags[p])})

    @cached_property
    def lead(self) -> ShownDifference | None:
        """What the best is over the best control, where both are there and it is known."""
        if self.best is None or self.control is None:
            return None
        return self.difference(self.best, self.control)

    @property
    def standing(self) -> str | None:
        """The key in `_STANDINGS` of how the best stands to the best control; None without both."""
        if self.best is None or self.control is None:
            return None
        difference = self.lead
        if _is_nothing(difference):
            return "alike"
        if difference is None or not difference.excludes_zero:
            return "untold"
        return "ahead" if difference.mean > 0 else "behind"

    @property
    def falls_short(self) -> bool:
        """Whether the best is ahead of the best control, or behind it, and has not been shown to be
        so by the gate.
        """
        if self.lead is None or self.standing not in ("ahead", "behind"):
            return False
        # Of a bound the asterisk alone says that the gate is reached, whatever was missed.
        reached = not self.lead.bound and abs(self.lead.mean) >= self.gate
        return not (reached or self.lead.asterisk)

    def findings(self) -> Iterator[str]:
        """One sentence, or none where there is nobody to compare."""
        best, control = self.best, self.control
        if best is None or len(self.levels) < 2:
            return
        first = max(self.levels, key=self.levels.__getitem__)
        over = {policy: self.difference(first, policy) for policy in self.levels if policy != first}
        tied = [first, *(policy for policy, each in over.items() if _is_nothing(each))]
        if len(tied) == len(self.levels):
            with_controls = ", controls included" if control else ""
            yield (
                f"{self.place}: all {len(tied)} policies {self.subject.all}, "
                f"{self.told(first)}{with_controls}."
            )
            return
        alike = [p for p, each in over.items() if p not in tied and not _is_ahead(each)]
        close = [p for p, each in over.items() if _is_ahead(each) and self._is_little(each)]
        leads = self.subject.one if len(tied) == 1 else self.subject.several
        # Beside a control that difference is the one to know.
        behind = [p for p in over if p not in (*tied, *alike, *close)] if control is None else []
        ahead = ""
        if behind:
            second = max(behind, key=self.levels.__getitem__)
            ahead = f", ahead of {second} ({interval(over[second])} {self.unit})"
        parts = [f"{self.place}: {_names(tied)} {leads}, {self.told(first)}{ahead}"]
        if alike:
            them = "it" if len(tied) == 1 else "them"
            parts.append(f"{_names(alike)} cannot be told from {them}")
        if close:
            verb = "is" if len(close) == 1 else "are"
            parts.append(f"{_names(close)} {verb} behind{self._by_little()}")
        if control is not None:
            parts.append(self._beside_control(best, control))
        yield f"{'; '.join(parts)}."

    def _beside_control(self, best: str, control: str) -> str:
        """How the best of the others stands to the best control."""
        difference = self.lead
        if self.standing == "alike":
            return f"the best control, {control}, does exactly as well as {best}"
        measured = f"({interval(difference)} {self.unit})"
        if self.standing == "untold":
            why = ", for some are never detected" if difference and difference.bound else ""
            return f"{best} and the best control, {control}, cannot be told apart{why} {measured}"
        little = f",{self._by_little()}" if self._is_little(difference) else ""
        if self.standing == "ahead":
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
    """What is said of all of them, setting by setting and then one by one, and among whom they
    choose; nothing where nothing is said.
    """
    contests = [*contests]
    said = [(contest, sentence) for contest in contests for sentence in contest.findings()]
    if not said:
        return []
    tags = {policy: contest.tags[policy] for contest, _ in said for policy in contest.levels}
    controls = any(map(is_control, tags.values()))
    who = "Who is first, the best control, and the best other policy are"
    chosen = who if controls else "Who is first is"
    return [
        *_standings(contests),
        *(sentence for _, sentence in said),
        f"Compared are the {len(tags)} policies played here"
        f"{'' if controls else ', no control among them: name fan or place, too'}.",
        f"{chosen} chosen at each budget by the very results that are compared, which favours "
        "whoever is chosen; the number of comparisons is not corrected for.",
    ]


def _standings(contests: Iterable[Contest]) -> Iterator[str]:
    """How in every setting the best that is no control stands to the best control, over the budgets
    at which both were compared; of one budget its own sentence tells it.
    """
    settings: dict[tuple[str, Subject], list[Contest]] = {}
    for contest in contests:
        if contest.standing is not None:
            settings.setdefault((contest.setting, contest.subject), []).append(contest)
    for (setting, subject), own in settings.items():
        if len(own) > 1:
            parts = [
                f"{words}{short} at {budgets}"
                for standing, words in _STANDINGS.items()
                for short in (
                    "",
                    f", not shown to reach the gate of {own[0].gate:g} {own[0].unit},",
                )
                if (budgets := _budgets(own, standing, bool(short)))
            ]
            controls = _names([*dict.fromkeys(each.control for each in own if each.control)])
            best = _names([*dict.fromkeys(each.best for each in own if each.best)])
            yield (
                f"{setting}, {subject.name}: compared with the best control of each budget "
                f"({controls}), the best other policy ({best}): {'; '.join(parts)}."
            )


def _budgets(contests: Iterable[Contest], standing: str, short: bool) -> str:
    """At which budgets it stands so."""
    return ", ".join(
        percent(each.budget)
        for each in contests
        if (each.standing, each.falls_short) == (standing, short)
    )


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
