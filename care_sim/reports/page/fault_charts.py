"""The charts of the fault study: what a measure does as every fault grows, one panel per fault."""

import math
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import altair as alt

from care_sim.base.errors import counted
from care_sim.reports.cells import StudyCells
from care_sim.reports.figures.faults import (
    MEASURES,
    CurveMeasure,
    Curves,
    fault_curves,
    flat_faults,
    flat_line,
)
from care_sim.reports.figures.styles import FULL_STYLE, styles
from care_sim.reports.page.chart import PANEL_WIDTH, Chart, Encoding, inline, specification
from care_sim.reports.tables.faults import policies_of
from care_sim.study.designs.faults import FAULT_PLACES, FAULTS, faults_alone
from care_sim.study.designs.variants import Place
from care_sim.study.run_config import Row

_LARGEST = 220.0
"""Area of the marks of the first policy, in square pixels."""
_LEAST = 15.0
"""Area of the marks of a policy after the last, in square pixels."""


def fault_charts(rows: Sequence[Row]) -> list[Chart]:
    """A chart for every place and measure."""
    study = StudyCells(faults_alone(rows))
    return [_chart(study, place, measure) for place, measure in product(FAULT_PLACES, MEASURES)]


def _chart(study: StudyCells, place: Place, measure: CurveMeasure) -> Chart:
    names = policies_of(study)
    known = styles((policy, study.tags.get(policy, ())) for policy in names if policy != "full") | {
        "full": FULL_STYLE
    }
    drawn = {study.marked(policy): style for policy, style in known.items()}
    encoding = Encoding.of_styles(drawn)
    # Areas fall by equal factors from the first policy to the last, so that each mark lies visibly
    # within the one before.
    ratio = (_LEAST / _LARGEST) ** (1 / len(names))
    curves = {fault.label: fault_curves(study, names, fault, place, measure) for fault in FAULTS}
    flat = flat_faults(curves)
    shown = {label: own for label, own in curves.items() if label not in flat}
    values = [
        value | {"area": round(_LARGEST * ratio**number, 1)}
        for number, policy in enumerate(names)
        for value in _values(study, shown, policy)
    ]
    chart = _panels(encoding, values)
    seeds = counted(len({row["seed"] for row in study.rows}), "seed")
    apart = "Marks of later policies are smaller, so that equal ones stay visible."
    hollow = "Hollow, at the bottom: the median is an actor that was not detected."
    return Chart(
        f"{place}: {measure.label}, {seeds}",
        f"{measure.label} at every strength of {counted(len(FAULTS) - len(flat), 'fault')}, "
        "a panel a fault, a curve a policy.",
        (
            apart,
            *([flat_line([label.partition(", ")[0] for label in flat])] if flat else []),
            *([hollow] if any(value["value"] is None for value in values) else []),
            *study.notes(study.policies),
        ),
        specification(chart.add_params(encoding.chosen)),
    )


def _panels(encoding: Encoding, values: Sequence[dict[str, Any]]) -> Any:
    """One panel per fault: curves of the policies over its strengths."""
    # One order for all panels. Each panel has a scale of its own and shows its strengths alone.
    strengths = sorted({value["level"] for value in values}, key=float)
    # Without data of its own: the facet below gives every panel its share.
    base = alt.Chart().encode(
        x=alt.X("level:O", sort=strengths, title=None, axis=alt.Axis(labelAngle=0)),
        y=alt.Y("value:Q", title=None),
        color=encoding.colour,
        opacity=encoding.opacity,
    )
    missed = base.transform_filter("datum.value == null").encode(y=alt.datum(0))
    nested = alt.Size("area:Q", scale=None, legend=None)
    about = [alt.Tooltip(f"{name}:N") for name in ("policy", "fault", "level")] + [
        alt.Tooltip("text:N", title="value")
    ]
    layers = alt.layer(
        base.mark_line(strokeWidth=1.5).encode(strokeDash=encoding.dash),
        base.mark_point(filled=True).encode(shape=encoding.shape, size=nested, tooltip=about),
        missed.mark_point(filled=False).encode(shape=encoding.shape, size=nested, tooltip=about),
    ).properties(width=PANEL_WIDTH, height=110)
    header = alt.Header(
        title=None, labelAnchor="start", labelExpr="split(datum.value, ', ')", labelFontSize=11
    )
    faults = [fault.label for fault in FAULTS]
    return layers.facet(
        facet=alt.Facet("fault:N", sort=faults, header=header), columns=5, data=inline(values)
    ).resolve_scale(x="independent")


def _values(study: StudyCells, curves: Mapping[str, Curves], policy: str) -> list[dict[str, Any]]:
    """The points of a policy, at every strength that was played of the faults with curves."""
    found = [
        (fault, level.label, height)
        for fault in FAULTS
        if fault.label in curves
        for level, height in zip(fault.levels, curves[fault.label][policy], strict=True)
    ]
    return [
        {
            "policy": study.marked(policy),
            "fault": fault.label,
            "level": label,
            "value": None if math.isnan(value) else round(value, 3),
            "text": "not detected" if math.isnan(value) else f"{value:.1f}",
        }
        for fault, label, value in found
        if value is not None
    ]
