"""What the charts of a page share: marks, colours and shapes of policies, and the form that the
browser draws.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import altair as alt
from matplotlib.colors import to_hex

from care_sim.base.errors import percent
from care_sim.reports.figures.styles import FULL_STYLE, Style, styles
from care_sim.reports.formatting import marked
from care_sim.reports.page.shapes import outline

FULL_SCAN = "full scan"
PANEL_WIDTH = 200
"""Width of a panel in pixels; the browser sets as many side by side as there is room for."""
_FAINT = 0.12
"""Opacity of what is not chosen in the legend."""
_DASHES = {"-": [1, 0], "--": [5, 3], ":": [2, 2]}


@dataclass(frozen=True)
class Chart:
    """A chart of a page: a title, what it shows in a sentence, how to read it, and its Vega-Lite
    specification.
    """

    title: str
    description: str
    notes: tuple[str, ...]
    spec: dict[str, Any]


def inline(values: Sequence[Mapping[str, Any]]) -> Any:
    """Rows of a chart, which its specification holds itself."""
    return alt.Data(values=list(values))  # type: ignore[no-untyped-call]


def specification(chart: Any) -> dict[str, Any]:
    """The specification without what the page sets for all charts."""
    spec: dict[str, Any] = chart.to_dict()
    # The page sets both once for all its charts.
    for name in ("config", "$schema"):
        spec.pop(name, None)
    return spec


@dataclass(frozen=True)
class Encoding:
    """Colour, shape and line of every name in the legend, and the selection by a click there."""

    colour: alt.Color
    shape: alt.Shape
    dash: alt.StrokeDash
    opacity: Any
    chosen: alt.Parameter

    @classmethod
    def of(cls, tags: Iterable[tuple[str, tuple[str, ...]]], full: bool) -> "Encoding":
        """The look of policies, given with their tags, and of the full scan."""
        tags = list(tags)
        drawn = {
            marked(policy, own): style
            for (policy, own), style in zip(tags, styles(tags).values(), strict=True)
        }
        return cls.of_styles(drawn | ({FULL_SCAN: FULL_STYLE} if full else {}))

    @classmethod
    def of_styles(cls, drawn: Mapping[str, Style]) -> "Encoding":
        """The look of names with these styles."""
        names = list(drawn)
        # A click on a name in the legend leaves its curve strong and all others faint.
        chosen = alt.selection_point(fields=["policy"], bind="legend")
        legend = alt.Legend(title=None)

        def scale(values: Sequence[Any]) -> alt.Scale:
            return alt.Scale(domain=names, range=list(values))

        return cls(
            alt.Color(
                "policy:N", scale=scale([to_hex(s.colour) for s in drawn.values()]), legend=legend
            ),
            alt.Shape(
                "policy:N", scale=scale([outline(s.marker) for s in drawn.values()]), legend=legend
            ),
            alt.StrokeDash(
                "policy:N", scale=scale([_DASHES[s.line] for s in drawn.values()]), legend=legend
            ),
            alt.condition(chosen, alt.value(1.0), alt.value(_FAINT)),
            chosen,
        )


def faceted(panels: Any, values: Sequence[Mapping[str, Any]], order: Sequence[str]) -> Any:
    """Panels side by side in this order, one for each text in `panel` of the values."""
    header = alt.Header(title=None, labelAnchor="start", labelFontSize=12)
    facet = alt.Facet("panel:N", sort=list(order), header=header)
    return panels.facet(facet=facet, columns=len(order), data=inline(values))


def budget_axis(budgets: Sequence[float], column: str = "place") -> alt.X:
    """A logarithmic axis of budgets with a mark at each."""
    return alt.X(
        f"{column}:Q",
        # A little wider than the budgets, so that no point lies on the edge; equal factors are
        # equal distances here.
        scale=alt.Scale(type="log", domain=[min(budgets) * 0.85, max(budgets) * 1.18], nice=False),
        axis=alt.Axis(
            values=list(budgets),
            labelExpr="format(datum.value * 100, '.3~g') + '%'",
            grid=False,
            labelOverlap=True,
        ),
        title="budget (share of cells fired)",
    )


def budgets_text(budgets: Sequence[float]) -> str:
    """Budgets from the least to the most, as text."""
    return f"{percent(min(budgets))} to {percent(max(budgets))}"
