"""The paper's statements under every order of cells: the verdict on each, and which of them depend
on the order.
"""

from collections.abc import Mapping
from typing import NamedTuple

from care_sim.reports.table import Bold, Table
from care_sim.study.designs.order import BASE_ORDER, MIRRORED_ORDER


class Verdict(NamedTuple):
    """What was found about a statement, in a word, and what was measured."""

    word: str
    measured: str


Verdicts = Mapping[str, Mapping[str, Verdict]]
"""By order, then by statement."""


def verdict_tables(title: str, verdicts: Verdicts, played: str) -> list[Table]:
    """The verdict on every statement under every order, and what was measured; none without
    statements. `played` says how much it rests on.
    """
    statements = list(dict.fromkeys(text for found in verdicts.values() for text in found))
    if not statements:
        return []
    usual = verdicts.get(BASE_ORDER, {})
    words: list[tuple[str, ...]] = []
    measured: list[tuple[str, ...]] = []
    for text in statements:
        found = [own.get(text, Verdict("", "")) for own in verdicts.values()]
        known = usual.get(text)
        words.append(
            (
                text,
                *(
                    Bold(each.word) if known and each.word not in ("", known.word) else each.word
                    for each in found
                ),
            )
        )
        measured.append((text, *(each.measured for each in found)))
    columns = ("statement", *verdicts)
    rule = f"Bold: another verdict than under {BASE_ORDER}."
    return [
        Table(title, columns, tuple(words), (rule, played), whole=tuple(verdicts)),
        Table(f"{title}, what was measured", columns, tuple(measured), (played,), terminal=False),
    ]


def on_mirrored_order(verdicts: Verdicts) -> list[str]:
    """How many statements keep their verdict where rows are numbered from the bottom; nothing where
    one of the two orders was not played.
    """
    down, up = verdicts.get(BASE_ORDER), verdicts.get(MIRRORED_ORDER)
    if not (down and up):
        return []
    kept = sum(text not in up or up[text].word == found.word for text, found in down.items())
    return [
        f"The paper: {kept} of {len(down)} statements have the same verdict under {BASE_ORDER} "
        f"and {MIRRORED_ORDER}."
    ]
