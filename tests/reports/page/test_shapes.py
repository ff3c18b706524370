"""Every policy of a chart has a shape of its own, whatever marker its figures give it."""

import re

import numpy as np
import pytest
from matplotlib.markers import MarkerStyle

from care_sim.policies import BUILT_IN
from care_sim.reports.figures.styles import styles
from care_sim.reports.page.budget_charts import budget_charts
from care_sim.reports.page.shapes import STROKE, outline
from tests.helpers.made_rows import rows

MANY = [f"policy-{number}" for number in range(20)]
MARKERS = {
    style.marker
    for tags in ((), ("privileged",))
    for style in styles((name, tags) for name in [*BUILT_IN, *MANY]).values()
}


def corners(text):
    return np.array(
        [[float(part) for part in pair.split(",")] for pair in re.findall(r"[ML]([^MLQCZ]+)", text)]
    )


def test_a_square_and_a_triangle_are_drawn_where_they_are():
    assert outline("s") == "M-1.000,1.000L1.000,1.000L1.000,-1.000L-1.000,-1.000Z"
    x, y = corners(outline("^")).T
    assert (y.min(), x[y.argmin()]) == (-1, 0), "the tip is up, where y is least"


def test_lines_are_bars_that_can_be_filled():
    x, y = corners(outline("_")).T
    assert (np.ptp(x), np.ptp(y)) == pytest.approx((2, STROKE), abs=1e-3)
    assert outline("1").count("Z") == outline("2").count("Z") == 3


@pytest.mark.parametrize("marker", sorted(MARKERS | {"_"}))
def test_every_marker_of_a_figure_has_a_shape(marker):
    shape = outline(marker)
    assert shape.startswith("M")
    assert shape.endswith("Z")
    assert np.abs(corners(shape)).max() <= np.sqrt(2)
    assert shape not in {outline(other) for other in MARKERS - {marker}}


def test_markers_that_matplotlib_fills_are_no_bars():
    assert [m for m in MARKERS if MarkerStyle(m).is_filled() != (outline(m).count("M") == 1)] == []


def test_a_chart_holds_every_policy_there_is():
    played = [
        each
        for name in [*BUILT_IN, *MANY]
        for budget in (0.05, 0.1)
        for each in rows_of(name, budget)
    ]
    (chart,) = budget_charts(played)
    assert str(chart.spec).count("'range'") >= 3


def rows_of(name, budget):
    (one,) = rows("care", [9.0], budget=budget)
    return [one | {"policy": name}]
