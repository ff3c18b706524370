"""A study that varies one factor, in either loop. Its tables: every cell under every condition,
differences from the usual condition, and the lead of one policy over the others.
"""

from collections.abc import Callable, Collection, Mapping, Sequence

from care_sim.base.errors import percent
from care_sim.reports.engine.contrasts import contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import level
from care_sim.reports.engine.measures import Measure, Recall, loop_of
from care_sim.reports.formatting import interval, marked
from care_sim.reports.table import Table, TableRow
from care_sim.study.rows.reading import Key
from care_sim.study.run_config import FULL

_NAMES = ("policy", "budget")
_Entry = Callable[[Frame, Measure | Recall, Key], str]


class Varied:
    """The rows of a study by the label of the condition; cells of one key differ in nothing but the
    condition. `what` is varied; `notes` stand under every table.
    """

    def __init__(self, what: str, frames: Mapping[str, Frame], notes: Sequence[str] = ()):
        self.frames = frames
        self.loop = loop_of(next(iter(frames.values())).rows)
        self.title = f"{self.loop.shown} by {what}"
        found = dict.fromkeys(key for frame in frames.values() for key in frame.groups)
        settings = list(dict.fromkeys(key[0] for key in found))
        self.keys = sorted(found, key=lambda key: (settings.index(key[0]), key[2]))
        self.tags = {
            policy: frame.tags[policy] for frame in frames.values() for _, policy, _ in frame.groups
        }
        self.notes = tuple(notes)

    def levels(self) -> Table:
        """Every cell under every condition."""
        return self._table(
            self.loop.level_unit,
            self.keys,
            [*self.frames],
            lambda frame, measure, key: level(measure, frame.units(measure, key)),
        )

    def minus_usual(self, usual: str, unfelt: Collection[str] = ()) -> Table:
        """Return what every condition adds to the usual one, without policies on which it has no
        effect.
        """
        base = self.frames.get(usual, Frame([]))
        return self._table(
            f"minus {usual}, {self.loop.difference_unit}",
            [key for key in self.keys if key[1] not in unfelt],
            [each for each in self.frames if each != usual],
            lambda frame, measure, key: interval(
                contrast(measure, frame.units(measure, key), base.units(measure, key))
            ),
            terminal=False,
        )

    def leads(self, policy: str) -> list[Table]:
        """Return the leads of a policy over each other one at the same budget; none where it is
        alone.
        """
        rivals = [key for key in self.keys if key[1] not in (policy, FULL)]
        if policy not in self.tags or not rivals:
            return []
        return [
            self._table(
                f"{policy} minus each, {self.loop.difference_unit}",
                rivals,
                [*self.frames],
                lambda frame, measure, key: interval(
                    frame.contrast(measure, (key[0], policy, key[2]), key)
                ),
            )
        ]

    def _table(
        self,
        unit: str,
        keys: Sequence[Key],
        conditions: Sequence[str],
        entry: _Entry,
        terminal: bool = True,
    ) -> Table:
        lines: list[TableRow] = []
        for setting in dict.fromkeys(key[0] for key in keys):
            for measure in self.loop.measures:
                lines.append((f"{setting.label}: {measure.heading}",))
                for key in (key for key in keys if key[0] == setting):
                    names = marked(key[1], self.tags[key[1]]), percent(key[2])
                    entries = (entry(self.frames[each], measure, key) for each in conditions)
                    lines.append((*names, *entries))
        return Table(
            f"{self.title}, {unit}",
            (*_NAMES, *conditions),
            tuple(lines),
            self.notes,
            whole=_NAMES,
            names=len(_NAMES),
            terminal=terminal,
        )
