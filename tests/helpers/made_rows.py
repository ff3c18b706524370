"""Rows made by hand."""

from care_sim.study.episode_config import grid
from care_sim.study.vehicle_play import VEHICLE_COUNTS, VEHICLE_LISTS, VEHICLE_MEASURES

NEAREST_M = 3.0
"""How near an actor came that was never detected."""


def row(config, distance, **changes):
    """The row of an episode with this detection distance, None for never."""
    outcome = {
        "detection_distance_m": distance,
        "undetected_to_m": NEAREST_M if distance is None else None,
        "braked": True,
        "min_distance_m": 5.0,
        "clearance_m": 3.0,
        "collision": False,
        "impact_speed_mps": None,
        "rays_fired": 1000,
    }
    return config.row() | outcome | changes


def vehicle_row(config, distance, **changes):
    """The row of an episode of the vehicle study, in which little was to be noted."""
    noted = dict.fromkeys(VEHICLE_COUNTS, 0) | dict.fromkeys(VEHICLE_LISTS, ())
    none = dict.fromkeys(VEHICLE_MEASURES)
    return row(config, distance) | {"keyframes": 10} | noted | none | changes


def rows(policy, distances, scenario="dense", budget=0.03, changes=None, **conditions):
    """One row a distance, of seeds from 0."""
    configs = grid([scenario], [policy], [budget], range(len(distances)), **conditions)
    return [
        row(config, distance, **(changes or {}))
        for config, distance in zip(configs, distances, strict=True)
    ]


STUDY = [
    *rows("history", [4.0, None, 8.0, 6.0, None]),
    *rows("all-camera", [10.0, 11.0, 12.0, 13.0, 14.0]),
    *rows("care", [15.0, 16.0, 17.0, 18.0, 19.0]),
    *rows("full", [15.0, 16.0, 17.0, 18.0, 19.5]),
]

CROWD = [
    each
    for vehicles, camera in ((0, 15.0), (5, 14.5), (9, 8.0), (12, None))
    for policy, distance in (("all-camera", camera), ("care", 15.0), ("full", 15.0))
    for each in rows(policy, [distance] * 5, scenario_parameters=(("vehicles", vehicles),))
]


def cut_ins(policy, impacts, budget=0.01, tags="causal", **changes):
    """The rows of two cut-ins of UN Regulation 157, at 40 and 60 km/h, with two seeds each; one
    impact speed a row in km/h, None where nothing was touched.
    """
    cases = (
        {"ego_kph": ego, "relative_kph": 20.0, "gap_m": 20.0, "lateral_mps": 1.0}
        | {"kind": "car", "side": "left"}
        for ego in (40.0, 60.0)
    )
    configs = [
        config
        for case in cases
        for config in grid(
            ["r157"], [policy], [budget], [0, 1], scenario_parameters=tuple(case.items())
        )
    ]
    return [
        row(config, 20.0, tags=tags, collision=kph is not None, **changes)
        | {"impact_speed_mps": None if kph is None else kph / 3.6}
        for config, kph in zip(configs, impacts, strict=True)
    ]


CUT_INS = [
    *cut_ins("history", [40.0, 39.5, 20.0, None]),
    *cut_ins("care", [None, None, None, None]),
    *cut_ins("fan", [None, None, 50.0, None], tags="control"),
    *cut_ins("stride", [30.0, None, 50.0, None], tags="control"),
    *cut_ins("full", [None, None, None, None]),
    *cut_ins("care", [None, None, 20.0, None], budget=0.03),
]


def as_in_the_paper(config, distance):
    """The row of an episode of the paper's study, first detected at this distance but in the
    cut-in: nobody is hit, and history brakes with three seeds of five.
    """
    history = config.policy == "history"
    return config.row() | {
        "detection_distance_m": 20.0 if config.scenario == "cutin" else distance,
        "undetected_to_m": None,
        "braked": not history or config.seed < 3,
        "min_distance_m": 4.0 if history else 5.7,
        "clearance_m": 3.0,
        "collision": False,
    }
