"""Tables of the order of cells inside a set: the paper's statements and the levels of all policies,
order by order, in either loop.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from care_sim.base.errors import counted, percent
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.measures import OPEN_LOOP
from care_sim.reports.engine.varied import Varied
from care_sim.reports.formatting import interval
from care_sim.reports.protocol.formatting import claim_in_short, verdict
from care_sim.reports.protocol.paper import claims_about
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.reports.table import Bold, Table
from care_sim.reports.tables.paper_statements import statements
from care_sim.study.designs.firing import (
    BASE_ORDER,
    MIRRORED_ORDER,
    rows_by_order,
    without_order,
)
from care_sim.study.run_config import FULL, Row


class _Verdict(NamedTuple):
    """Verdict on a statement in a word, and the measurement."""

    word: str = ""
    measured: str = ""


class OrderCells(Varied):
    """The rows of the study by order."""

    def __init__(self, rows: Sequence[Row]):
        self.once = without_order(rows)
        notes = [f"Feel no order, played once: {', '.join(self.once)}."] if self.once else []
        frames = {order: Frame(own) for order, own in rows_by_order(rows).items()}
        super().__init__("order of cells", frames, notes)
        self.orders = tuple(frames)


def order_tables(rows: Sequence[Row]) -> list[Table]:
    """The paper's statements by order, then levels and their differences to the usual order."""
    study = OrderCells(rows)
    if set(study.tags) <= {FULL}:
        return []
    return [
        *_statement_tables(study),
        study.levels(),
        study.minus_usual(BASE_ORDER, unfelt=study.once),
    ]


def order_closing(rows: Sequence[Row]) -> list[str]:
    """How many statements keep their verdict where rows are numbered from the bottom; nothing where
    one of the two orders was not played.
    """
    found = _verdicts(OrderCells(rows))
    down, up = found.get(BASE_ORDER), found.get(MIRRORED_ORDER)
    if not (down and up):
        return []
    kept = sum(text not in up or up[text].word == one.word for text, one in down.items())
    return [
        f"The paper: {kept} of {len(down)} statements have the same verdict under {BASE_ORDER} "
        f"and {MIRRORED_ORDER}."
    ]


def _statement_tables(study: OrderCells) -> list[Table]:
    """The verdict on every statement under every order, and what was measured; none without
    statements.
    """
    verdicts = _verdicts(study)
    words: list[tuple[str, ...]] = []
    measured: list[tuple[str, ...]] = []
    for text in dict.fromkeys(text for found in verdicts.values() for text in found):
        found = [own.get(text, _Verdict()) for own in verdicts.values()]
        usual = verdicts.get(BASE_ORDER, {}).get(text, _Verdict()).word
        other = [bool(usual) and each.word not in ("", usual) for each in found]
        entries = (Bold(e.word) if bold else e.word for e, bold in zip(found, other, strict=True))
        words.append((text, *entries))
        measured.append((text, *(each.measured for each in found)))
    if not words:
        return []
    most = max(len(own) for each in study.frames.values() for own in each.groups.values())
    played = f"Each cell has at most {counted(most, 'row')}."
    rule = f"Bold: another verdict than under {BASE_ORDER}."
    title = "The paper's statements by order of cells"
    columns = ("statement", *study.orders)
    return [
        Table(title, columns, tuple(words), (rule, played), whole=study.orders),
        Table(f"{title}, what was measured", columns, tuple(measured), (played,), terminal=False),
    ]


def _verdicts(study: OrderCells) -> dict[str, dict[str, _Verdict]]:
    """Every statement of the paper on what was played, by order."""
    rows = {order: frame.rows for order, frame in study.frames.items()}
    if study.loop is OPEN_LOOP:
        return {order: dict(_judged(plays_by_setting(own)[0])) for order, own in rows.items()}
    return {
        order: {each.text: _Verdict(each.verdict, each.measured) for each in statements(own)}
        for order, own in rows.items()
    }


def _judged(plays: SettingPlays) -> Iterator[tuple[str, _Verdict]]:
    for each, claims in claims_about(plays.setting).items():
        if not set(each.policies) <= set(plays.policies):
            continue
        for budget in plays.budgets:
            claim = claims.at(budget)
            found = each.measured(plays, budget) if claim else None
            if claim and found:
                text = f"{each.label}, {each.heading.lower()}, {percent(budget)}"
                yield (
                    f"{text} (paper: {claim_in_short(claim)})",
                    _Verdict(verdict(found, claim.sign), interval(found)),
                )
