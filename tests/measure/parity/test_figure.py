"""The figure of parity, on counts made by hand."""

from care_sim.measure.parity.figure import parity_figure
from care_sim.measure.parity.tally import GROUPS, REFERENCE_NAMES


def scans_of(references, scans):
    """Rays that meet upright boxes, and how many of them are the same, against each reference."""
    counts = {
        reference: {group: {"rays": 0, "same": 0} for group in GROUPS}
        | {"boxes, upright": {"rays": rays, "same": same}}
        for reference, (rays, same) in references.items()
    }
    return {"scans": scans, "references": counts}


def test_the_figure_shows_the_share_of_rays_that_differ_scenarios_in_one_panel():
    one, other = ((1000, 1000), (1000, 999)), ((3000, 2997), (3000, 3000))
    report = {
        "scans": {
            "random scenes": scans_of(dict(zip(REFERENCE_NAMES, one, strict=True)), 7),
            "dartout": scans_of(dict(zip(REFERENCE_NAMES, one, strict=True)), 2),
            "dense": scans_of(dict(zip(REFERENCE_NAMES, other, strict=True)), 3),
        }
    }
    panels = parity_figure(report).axes
    assert [axes.get_title(loc="left") for axes in panels] == [
        "random scenes: 7 scans",
        "keyframes of the scenarios: 5 scans",
    ]
    shown = [[line.get_xydata().tolist() for line in axes.lines] for axes in panels]
    place = GROUPS.index("boxes, upright")
    assert shown == [[[[0.0, place]], [[1000.0, place]]], [[[750.0, place]], [[250.0, place]]]]
