"""Captions explain what their tables show, and nothing else."""

import pytest

from care_sim.reports.captions import (
    EPISODES_CAPTION,
    MECHANISM_CAPTION,
    PROTOCOL_CAPTION,
    Remark,
    caption,
)
from care_sim.reports.table import Bold, Table

PLAIN = Table("recall", ("policy", "10%"), (("care", "50.0"),))


def table_of(entry):
    return Table("recall", ("policy", "10%"), (("care", "50.0"), ("history", entry)))


@pytest.mark.parametrize(
    ("entry", "remarks", "explained"),
    [
        ("not detected", EPISODES_CAPTION, "reads 'not detected'"),
        ("≥-8.0", EPISODES_CAPTION, "≥: at least"),
        ("+3.0*", EPISODES_CAPTION, "Asterisk"),
        ("Preventable collisions avoided", EPISODES_CAPTION, "full scan collides with nobody"),
        ("Collisions avoided", EPISODES_CAPTION, "gate of collisions is 10 points"),
        (Bold("+3.0"), EPISODES_CAPTION, "Bold"),
        (Bold("+3.0"), PROTOCOL_CAPTION, "Bold"),
        ("+3.0 °", PROTOCOL_CAPTION, "Marked °"),
        ("met (paper: +5.2)", PROTOCOL_CAPTION, "what the paper reports"),
    ],
)
def test_a_mark_is_explained_where_a_table_shows_it(entry, remarks, explained):
    assert explained in caption(remarks, [PLAIN, table_of(entry)])
    assert explained not in caption(remarks, [PLAIN, table_of("+3.0")])


@pytest.mark.parametrize(
    ("column", "remarks", "explained"),
    [
        ("clearance m", EPISODES_CAPTION, "Clearance"),
        ("regret m", EPISODES_CAPTION, "Regret"),
        ("pass m", EPISODES_CAPTION, "Pass:"),
        ("never", EPISODES_CAPTION, "Never:"),
        ("TTFD", PROTOCOL_CAPTION, "TTFD"),
        ("equal scenes: first sightings %", PROTOCOL_CAPTION, "equal scene weights"),
        ("(paper)", MECHANISM_CAPTION, "What the paper reports"),
    ],
)
def test_a_column_is_explained_where_a_table_has_it(column, remarks, explained):
    there = Table("recall", ("policy", column), (("care", "50.0"),))
    assert explained in caption(remarks, [there])
    assert explained not in caption(remarks, [PLAIN])


def test_remarks_stand_in_their_order_and_those_about_nothing_always():
    remarks = (Remark("One."), Remark("Two.", ("care",)), Remark("Three.", ("fan",)))
    assert caption(remarks, [PLAIN]) == "One. Two."
    assert caption(remarks, []) == "One."
