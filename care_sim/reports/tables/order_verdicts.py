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
    usual = verdicts.get(BASE_ORDER, {})
    found = {
        text: [own.get(text, Verdict("", "")) for own in verdicts.values()]
        for text in dict.fromkeys(text for own in verdicts.values() for text in own)
    }
    if not found:
        return []
    words = tuple(
        (text, *(_against(each.word, usual.get(text)) for each in own))
        for text, own in found.items()
    )
    measured = tuple((text, *(each.measured for each in own)) for text, own in found.items())
    columns = ("statement", *verdicts)
    rule = f"Bold: another verdict than under {BASE_ORDER}."
    return [
        Table(title, columns, words, (rule, played), whole=tuple(verdicts)),
        Table(f"{title}, what was measured", columns, measured, (played,), terminal=False),
    ]


def _against(word: str, usual: Verdict | None) -> str:
    return Bold(word) if usual and word not in ("", usual.word) else word


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
