"""The paper's statements under every order of cells: the verdict on each, and which of them hang on
the order.
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
_RULE = f"Bold: another verdict than under {BASE_ORDER}."


def verdict_tables(title: str, verdicts: Verdicts, played: str) -> list[Table]:
    """The verdict on every statement under every order, and what was measured; none without
    statements. `played` says how much it rests on.
    """
    statements = list(dict.fromkeys(text for found in verdicts.values() for text in found))
    if not statements:
        return []
    columns = ("statement", *verdicts)
    usual = verdicts.get(BASE_ORDER, {})
    words = [
        (text, *(_word(found.get(text), usual.get(text)) for found in verdicts.values()))
        for text in statements
    ]
    measured = [
        (text, *(found[text].measured if text in found else "" for found in verdicts.values()))
        for text in statements
    ]
    return [
        Table(title, columns, tuple(words), (_RULE, played), whole=tuple(verdicts)),
        Table(f"{title}, what was measured", columns, tuple(measured), (played,), terminal=False),
    ]


def _word(found: Verdict | None, usual: Verdict | None) -> str:
    if found is None:
        return ""
    return found.word if usual is None or found.word == usual.word else Bold(found.word)


def on_mirrored_order(verdicts: Verdicts) -> list[str]:
    """How many statements keep their verdict where rows are numbered from the bottom, and which do
    not; nothing where one of the two orders was not played.
    """
    if not (verdicts.get(BASE_ORDER) and verdicts.get(MIRRORED_ORDER)):
        return []
    down = verdicts[BASE_ORDER]
    up = verdicts[MIRRORED_ORDER]
    changed = [
        f"{text} ({found.word}, then {up[text].word})"
        for text, found in down.items()
        if text in up and up[text].word != found.word
    ]
    kept = len(down) - len(changed)
    others = f"; with another: {'; '.join(changed)}" if changed else ""
    return [
        f"Of the paper's {len(down)} statements, {kept} have the same verdict under {BASE_ORDER} "
        f"and under {MIRRORED_ORDER}{others}."
    ]
