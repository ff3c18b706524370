"""Levels against the budget, from plays."""

from fnmatch import fnmatch

import pytest

from care_sim.reports.figures.protocol import protocol_figures
from care_sim.reports.studies import STUDIES
from tests.helpers.drawn import heights
from tests.helpers.made_plays import study

FOUND = {
    "history": (4, 6),
    "care": (6, 5),
    "beam-reduce": (5, 2),
    "history-oracle": (7, 7),
    "full": (8, 8),
}
ROWS = study(FOUND)


def test_every_setting_has_its_figure_and_their_names_are_known():
    rows = [
        *ROWS,
        *study(FOUND, camera_latency=1),
        *study(FOUND, camera_latency=2, budgets=(0.1,)),
        *study({"full": (8, 8)}, source="nuscenes"),
    ]
    figures = protocol_figures(rows)
    assert list(figures) == ["levels-streets", "levels-streets-camera-latency-1"]
    patterns = STUDIES["protocol"].figures_of()
    assert all(any(fnmatch(name, pattern) for pattern in patterns) for name in figures)
    assert not any(fnmatch("levels-mine", pattern) for pattern in patterns)
    own = STUDIES["protocol"].figures_of([row | {"source": "mine:Film"} for row in rows])
    assert any(fnmatch("levels-mine-Film", pattern) for pattern in own)


def test_levels_have_a_line_a_policy_the_full_scan_and_what_the_paper_reports():
    first, overall = protocol_figures(ROWS)["levels-streets"].axes
    assert heights(first) == {
        "full scan": [40.0, 40.0],
        "history": [20.0] * 3,
        "care": [30.0] * 3,
        "beam-reduce": [25.0] * 3,
        "history-oracle †": [35.0] * 3,
    }
    assert heights(overall)["full scan"] == [80.0, 80.0]
    said = [line for line in overall.lines if line.get_label() == "_paper"]
    assert [list(line.get_ydata()) for line in said if line.get_linestyle() == ":"] == [[49.4] * 2]
    assert [pytest.approx(0.94 * 49.4)] in [list(line.get_ydata()) for line in said]
    strict = [row | {"camera_latency": 1} for row in ROWS]
    (panel, _) = protocol_figures(strict)["levels-streets-camera-latency-1"].axes
    assert "_paper" not in {line.get_label() for line in panel.lines}
