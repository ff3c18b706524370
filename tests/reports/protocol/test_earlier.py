"""Events detected earlier, later or at the same keyframe as history, of logs without labels."""

from care_sim.reports.protocol.tables import protocol_tables
from tests.helpers.made_plays import play


def rows(source):
    delays = {
        ("history", 0): [0, 3, 6, 6],
        ("history", 1): [0, 3, 6, 6],
        ("care", 0): [0, 1, 6, 4],
        ("care", 1): [1, 1, 6, 4],
    }
    return [
        play("one", policy, each, [5] * 4, source=source, floor_seed=seed)
        for (policy, seed), each in delays.items()
    ]


def test_counts_are_means_over_floor_seeds():
    first = protocol_tables(rows("sweeps"))[0]
    assert "events detected earlier, later or at the same keyframe as history" in first.title
    assert first.columns == ("budget", "policy", "earlier", "later", "tied")
    assert first.rows == (("10%", "care", "2.0", "0.5", "1.5"),)


def test_sources_with_labels_have_no_such_table():
    titles = [table.title for table in protocol_tables(rows("nuscenes"))]
    assert not any("earlier, later" in title for title in titles)
