"""Rows of the first-sighting protocol made by hand, with answers that are known."""

from dataclasses import asdict, fields

from care_sim.core.conditions import Conditions
from care_sim.evaluation.recall import CENSORED_AT, Tally

FRAMES = 10
"""Object frames an event."""
STRATA = {
    "range": ("below 20 m", "20 to 35 m", "from 35 m"),
    "azimuth": ("front", "side", "rear"),
    "class": ("car", "truck", "bus", "bicycle", "pedestrian"),
    "entry": ("emergence", "ring", "beyond"),
}
"""The entries are only those that events have; every object frame is of an event here."""
TAGS = {
    "history-oracle": "privileged",
    "random-points": "non-causal",
    "rows": "causal+control",
    "place": "causal+control",
    "seed-finder": "generator+control",
}


def play(
    scene, policy, delays, frames_found, *, budget=0.1, source="streets", detector="returns", **more
):
    """A play that found each event after these keyframes, and of each event's object frames so
    many.
    """
    known = {field.name for field in fields(Conditions)}
    conditions = Conditions(**{name: value for name, value in more.items() if name in known})
    others = {name: value for name, value in more.items() if name not in known}
    row = {
        "source": source,
        "scene": scene,
        "policy": policy,
        "budget": 1.0 if policy == "full" else budget,
        "detector": detector,
        **asdict(conditions),
        "tags": TAGS.get(policy, "causal"),
        "keyframes": 40,
        "film_hash": f"film of {scene}",
        **_tallies(delays, frames_found),
        "ttfds": tuple(delays),
        "tracks": 5.0,
        "explained": 3.0,
        "differing_keyframes": None if policy in ("care", "full") else 4,
        "differing_cells": None if policy in ("care", "full") else 200,
    }
    return row | others


def found(events, at_once, late=0):
    """Delays of so many events, the first ones found at once, the next ones a keyframe late, the
    rest never.
    """
    return [0] * at_once + [1] * late + [CENSORED_AT] * (events - at_once - late)


def study(plays, scenes=6, budgets=(0.1, 0.2, 0.35), seeds=(0, 1, 2), events=20, **more):
    """`plays[policy]` is (events found at once, object frames found an event), for every scene
    alike.
    """
    return [
        play(
            f"scene {n:03d}",
            policy,
            found(events, sighted),
            [frames] * events,
            budget=b,
            floor_seed=seed,
            **more,
        )
        for policy, (sighted, frames) in plays.items()
        for b in ((1.0,) if policy == "full" else budgets)
        for seed in ((0,) if policy == "full" else seeds)
        for n in range(scenes)
    ]


def _tallies(delays, frames_found):
    """Events take turns in the strata of every kind."""
    columns = asdict(_tally(delays, frames_found))
    for kind, labels in STRATA.items():
        for n, label in enumerate(labels):
            part = _tally(delays[n :: len(labels)], frames_found[n :: len(labels)])
            columns |= {f"{kind}/{label}/{name}": value for name, value in asdict(part).items()}
    return columns


def _tally(delays, frames_found):
    sighted = sum(delay == 0 for delay in delays)
    counts = len(delays), sighted, sum(delays), FRAMES * len(delays), sum(frames_found)
    return Tally(*map(float, counts))
