"""Tables of separate plays: who found an event first, whose rays did, and why others missed it."""

from itertools import combinations, permutations

from care_sim.evaluation.miss_reasons import MISS_REASONS
from care_sim.evaluation.ray_shares import RAY_SHARES
from care_sim.reports.mechanism import paper
from care_sim.reports.mechanism.formatting import (
    figure_of_paper,
    heading_of,
    marks_of,
    name_of,
    quotes_of_paper,
)
from care_sim.reports.mechanism.rows import MechanismRows
from care_sim.reports.protocol.formatting import PAPER
from care_sim.reports.table import Table

_CREDIT_COLUMNS = tuple(share.replace("_", " ") for share in RAY_SHARES)


def order_table(study: MechanismRows) -> Table:
    """Who found the events first, each policy on its own play."""
    lines = []
    for first, second in combinations(study.policies, 2):
        order = study.order(first, second)
        said = figure_of_paper(study, paper.ORDER.get((first, second), ""))
        counts = map(str, (order.earlier, order.later, order.tied))
        lines.append((name_of(study, first), name_of(study, second), *counts, said))
    return Table(
        heading_of(study, "events found earlier, later or at the same keyframe"),
        ("first", "second", "earlier", "later", "tied", f"{PAPER} of 104"),
        tuple(lines),
        (
            "Each policy on its own play; two that do not find an event within 6 keyframes are "
            "tied.",
            *marks_of(study),
        ),
        quotes_of_paper(study, paper.VEHICLE_ORDER),
    )


def credit_table(study: MechanismRows) -> Table:
    """Who fired the rays of the first sightings that one policy caught and another missed."""
    lines = []
    for caught, missed in permutations(study.policies, 2):
        credit, tracked = study.credit(caught, missed)
        # A pair without such a sighting has nothing to share out.
        if len(credit):
            shares = (f"{100 * share:.0f}%" for share in credit.mean(axis=0))
            names = name_of(study, caught), name_of(study, missed)
            lines.append((*names, str(len(credit)), *shares, str(tracked.sum())))
    return Table(
        heading_of(study, "whose rays caught what the other missed"),
        ("caught by", "missed by", "first sightings", *_CREDIT_COLUMNS, "tracked already"),
        tuple(lines),
        (
            "Of the rays that hit the object at its first keyframe, in the play that caught it; "
            "every sighting weighs the same. Layer 1 of care is U. Tracked already: sightings of "
            "objects that the catching policy had detected before, beyond 50 m.",
            *marks_of(study),
        ),
    )


def misses_table(study: MechanismRows) -> Table:
    """Why policies missed first sightings that the full scan finds."""
    lines = []
    for policy in study.policies:
        misses = study.misses(policy)
        counts = map(str, (study.found_by_full(policy), sum(misses.values()), *misses.values()))
        lines.append((name_of(study, policy), *counts))
    return Table(
        heading_of(study, "why first sightings were missed that the full scan finds"),
        ("policy", "found by full", "missed", *MISS_REASONS),
        tuple(lines),
        (
            "Of a policy that never asks the camera, the first three reasons tell what the camera "
            "would have shown it.",
            *marks_of(study),
        ),
    )
