"""The list of the certificate holds all that can meet, and every argument but those that are left
out for a reason.
"""

from dataclasses import fields
from itertools import combinations

from care_sim.certify import CERTIFIED_EPISODES
from care_sim.certify.design import (
    CERTIFIED_CAMERAS,
    CERTIFIED_CHOICES,
    CERTIFIED_DETECTORS,
    CERTIFIED_FAULTS,
    CERTIFIED_POLICIES,
    CERTIFIED_WITHOUT,
    CERTIFIED_WORLDS,
    CLOSED,
    CLUTTER,
    DRAWN_TEST,
    NCAP,
    REPLAY,
    STREET,
    drawn,
)
from care_sim.core.conditions import (
    CAMERA_PROFILES,
    DEFAULTS,
    IDEAL_CAMERA,
    LOCALISATION,
    CameraFaults,
    LidarFaults,
    ReturnSettings,
)
from care_sim.envs import IDS
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.scenes import ReplayEnv, StreetEnv
from care_sim.envs.sensing import arguments_of
from care_sim.perception.detectors import DETECTORS, PROXY
from care_sim.policies import BUILT_IN
from care_sim.scenarios import make_scenario

LIST = [drawn(number) for number in range(CERTIFIED_EPISODES)]
ENVIRONMENTS = {*CLOSED, STREET, REPLAY}
OF_A_WORLD = {"drawn test": NCAP, "clutter": STREET}
CHOICES = {name: choice for group, _ in CERTIFIED_CHOICES for name, choice in group.items()} | {
    "drawn test": DRAWN_TEST,
    "clutter": CLUTTER,
}
LISTED = {name for choice in CHOICES.values() for name in choice}
"""Arguments that the list holds."""
ALTERNATIVES = (
    ENVIRONMENTS,
    {*CERTIFIED_POLICIES},
    *({*group} for group, numbers in CERTIFIED_CHOICES if max(numbers) == 1),
)
"""An episode has one part of each group at most."""
LEFT_OUT = {
    "detector_parameters": "the benchmark plays measured detectors by their defaults",
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
    "sweep_mask": "of films with sweeps between their keyframes",
    "sweeps": "of nuScenes",
    "camera_times": "of nuScenes",
    "empty_boxes": "of nuScenes and Argoverse 2",
    **dict.fromkeys(("reference", "topics"), "of logs without labels"),
    "lidar_compensated": "moves points, which no detector of the list reads",
}
"""Arguments that the list does not hold, and why."""


DETECTORS_LEFT_OUT = {
    "graded": "its luck is drawn from places in whole centimetres, which a last bit may change",
    "cluster": "ends a little differently on another processor",
    "pillars": "sums differently on another processor",
    **dict.fromkeys(("recorded", "torchscript", "onnx"), "needs a file of the user's"),
}
"""Detectors that the list does not hold, and why."""


def parts(episode):
    """Return the environment, the policy and the choices of an episode."""
    given = dict(episode.arguments).items()
    chosen = [name for name, choice in CHOICES.items() if choice.items() <= given]
    return sorted([episode.environment, episode.policy, *chosen])


def can_meet(one, other):
    one, other = (OF_A_WORLD.get(part, part) for part in (one, other))
    if one == other:
        return True
    lacking = {*CERTIFIED_WITHOUT.get(one, ()), *CERTIFIED_WITHOUT.get(other, ())}
    return not {one, other} & lacking and not any({one, other} <= each for each in ALTERNATIVES)


def test_the_episodes_that_are_played_hold_every_pair_that_can_meet():
    met = {pair for episode in LIST for pair in combinations(parts(episode), 2)}
    pairs = combinations(sorted([*ENVIRONMENTS, *CERTIFIED_POLICIES, *CHOICES]), 2)
    assert met == {pair for pair in pairs if can_meet(*pair)}


def test_every_fault_of_the_conditions_is_in_the_list():
    kinds = CameraFaults, LidarFaults, ReturnSettings
    faults = {field.name for kind in kinds for field in fields(kind)}
    choices = [*CERTIFIED_FAULTS.values(), *CERTIFIED_CAMERAS.values()]
    listed = {name for one in choices for name in one}
    assert listed == (faults | {"ego_speed_sigma", *LOCALISATION}) - {*LEFT_OUT}
    profiles = {one.get("camera_profile", IDEAL_CAMERA) for one in CERTIFIED_CAMERAS.values()}
    assert profiles == {*CAMERA_PROFILES}


def test_every_detector_is_in_the_list_or_left_out_for_a_reason():
    listed = {one.get("detector", PROXY) for one in CERTIFIED_DETECTORS.values()}
    assert {*DETECTORS_LEFT_OUT} == {*DETECTORS.built_in} - listed


def test_every_argument_is_in_the_list_or_left_out_for_a_reason():
    taken = {name for kind in (ClosedLoopEnv, StreetEnv, ReplayEnv) for name in arguments_of(kind)}
    assert {*LEFT_OUT} == taken - {"budget"} - LISTED


def test_no_setting_of_the_list_is_the_default():
    given = [item for choice in CHOICES.values() for item in choice.items()]
    assert not [name for name, value in given if DEFAULTS.get(name) == value]


def test_worlds_take_the_parameters_of_the_list():
    for name in CERTIFIED_WORLDS.keys() & {*CLOSED}:
        usual = make_scenario(name.split("-")[1].lower())
        for parameters in CERTIFIED_WORLDS[name]:
            scenario = make_scenario(name.split("-")[1].lower(), **parameters)
            assert (scenario != usual) == bool(parameters)


def test_every_environment_and_built_in_policy_is_in_the_list_which_does_not_move():
    """A policy that is missing is added at the end, and the list is published anew."""
    assert {*IDS} == ENVIRONMENTS
    assert {*BUILT_IN} == {*CERTIFIED_POLICIES}
    assert len({e.text for e in LIST}) == len(LIST)
