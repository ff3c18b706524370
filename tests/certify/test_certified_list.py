"""The list of the certificate holds all that can meet, and every argument but those that are left
out for a reason.
"""

from dataclasses import fields
from itertools import combinations, product

from care_sim.certify import CERTIFIED_EPISODES
from care_sim.certify.design import (
    CERTIFIED_DRIVERS,
    CERTIFIED_FAULTS,
    CERTIFIED_POLICIES,
    CERTIFIED_SETTINGS,
    CERTIFIED_WORLDS,
    CLOSED,
    DRAWN_TEST,
    REPLAY,
    STREET,
    drawn,
)
from care_sim.core.conditions import (
    DEFAULTS,
    LOCALISATION,
    RETURN_SETTINGS,
    CameraFaults,
    LidarFaults,
)
from care_sim.envs import IDS
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.scenes import ReplayEnv, StreetEnv
from care_sim.envs.sensing import arguments_of
from care_sim.policies import BUILT_IN
from care_sim.scenarios import make_scenario

LIST = [drawn(number) for number in range(CERTIFIED_EPISODES)]
OF_EVERY_WORLD = {
    name
    for choices in (CERTIFIED_FAULTS, CERTIFIED_SETTINGS, CERTIFIED_DRIVERS)
    for one in choices.values()
    for name in one
}
"""Arguments that the list holds whatever the world."""
LEFT_OUT = {
    "detector": "`cluster` ends a little differently on another processor",
    "detector_parameters": "the paper's proxy has none",
    "presence": "decides which objects are counted, nothing that is played",
    "secret": "is hashed into every stream: a street would have to be made for it",
    "sensor": "the default alone: another set-up needs weights and maps of its own",
    "scoring_info": "decides what is told, not what is played",
    "render_mode": "pictures are no part of a trail",
    "source": "the recording is the list's own",
    "scene": "it has one",
    "split": "of nuScenes",
    "version": "of nuScenes",
    "camera_detections": "a file of the user's",
    "camera_latency_s": "begins with the next list: one more choice changes every episode of this",
    "camera_profile": "begins with the next list, too",
    "sweep_mask": "of films with sweeps between their keyframes",
    "clutter": "begins with the next list: fitted numbers may still move",
    "velocity_keyframes": "smooths the errors of measured detectors, which the list has not",
    "sweeps": "of nuScenes",
    "camera_times": "of nuScenes",
    "empty_boxes": "of nuScenes and Argoverse 2",
    **dict.fromkeys(("reference", "topics"), "of logs without labels"),
    **dict.fromkeys(LOCALISATION, "begin with the next list, too"),
    **dict.fromkeys(RETURN_SETTINGS, "recordings refuse them, but for crosstalk"),
}
"""Arguments that the list does not hold, and why."""


def test_the_episodes_that_are_played_hold_every_pair_that_can_meet():
    environments = {*CLOSED, STREET, REPLAY}
    met = [(e.environment, e.policy, {name for name, _ in e.arguments}) for e in LIST]
    assert {(e, p) for e, p, _ in met} == set(product(environments, CERTIFIED_POLICIES))
    assert {(p, n) for _, p, given in met for n in given} >= set(
        product(CERTIFIED_POLICIES, {*OF_EVERY_WORLD, *DRAWN_TEST})
    )
    faults = {name for one in CERTIFIED_FAULTS.values() for name in one}
    together = {pair for *_, given in met for pair in combinations(sorted(given), 2)}
    assert together >= set(combinations(sorted(faults), 2))


def test_every_fault_of_the_conditions_is_in_the_list():
    faults = {field.name for kind in (CameraFaults, LidarFaults) for field in fields(kind)} | {
        "ego_speed_sigma"
    }
    assert {name for one in CERTIFIED_FAULTS.values() for name in one} == faults - {*LEFT_OUT}


def test_every_argument_is_in_the_list_or_left_out_for_a_reason():
    taken = {name for kind in (ClosedLoopEnv, StreetEnv, ReplayEnv) for name in arguments_of(kind)}
    assert {*LEFT_OUT} == taken - {"budget"} - OF_EVERY_WORLD


def test_no_setting_of_the_list_is_the_default():
    for choices in (CERTIFIED_FAULTS, CERTIFIED_SETTINGS, CERTIFIED_DRIVERS):
        given = {name: value for one in choices.values() for name, value in one.items()}
        assert not [name for name, value in given.items() if DEFAULTS.get(name) == value]


def test_worlds_take_the_parameters_of_the_list():
    for name, choices in CERTIFIED_WORLDS.items():
        usual = make_scenario(name.split("-")[1].lower())
        for parameters in choices:
            scenario = make_scenario(name.split("-")[1].lower(), **parameters)
            assert (scenario != usual) == bool(parameters)


NOT_YET_CERTIFIED = (
    "boxes",
    "tuned-place",
    "after-shoouri",
    "after-ancha",
    "after-gofer",
    "care-aimed",
)
"""Policies newer than the list."""


def test_every_environment_and_built_in_policy_is_in_the_list_which_does_not_move():
    """A policy that is missing is added at the end, and the list is published anew."""
    assert {*CLOSED, STREET, REPLAY} == {*IDS}
    assert {*BUILT_IN} == {*CERTIFIED_POLICIES, *NOT_YET_CERTIFIED}
    assert len({e.text for e in LIST}) == len(LIST)
