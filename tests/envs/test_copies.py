"""An environment and its policy that are copied or pickled in mid-episode play on as if alone."""

import copy
import pickle
from dataclasses import dataclass

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.envs.scenarios import ScenarioEnv
from care_sim.perception import lifetimes
from care_sim.perception.network_detectors import OnnxDetector
from care_sim.perception.points_only import PointsOnly
from care_sim.scenarios.dartout import Dartout
from tests.helpers.network_files import counting_script, mean_onnx, middle_script
from tests.helpers.short_streets import few_and_short
from tests.helpers.vectors import difference

FAULTS = {
    "camera_latency": 1,
    "camera_jitter": 1,
    "false_negative_rate": 0.3,
    "lidar_dropout": 0.2,
    "lidar_range_sigma": 0.05,
    "ego_speed_sigma": 0.2,
}
CASES = [
    ("CARE-Dense-v0", "care", FAULTS | {"lidar_sweep_s": 0.1}),
    ("CARE-Dartout-v0", "random", {"engine": "bullet", "camera_profile": "yolox"}),
    ("CARE-Dense-v0", "care", {"camera_profile": "kitti", "false_positive_rate": 0.5}),
    ("CARE-CutIn-v0", "history", {"detector": "cluster", "firing": "azimuth-window"}),
    ("CARE-R157-v0", "learned-sets", {"driver": "careful-human", "detector": "centerpoint"}),
    ("CARE-NCAP-v0", "care-sector", {"test": "CPTAns-50", "speed_kph": 10.0}),
    ("CARE-Drive-v0", "care-sightlines", FAULTS),
    ("CARE-Street-v0", "care", FAULTS | {"lidar_sweep_s": 0.1}),
    ("CARE-Replay-v0", "all-camera", FAULTS),
]


def play(env, policy, observation, steps):
    """The last observation, and all that was done and given."""
    told = []
    for _ in range(steps):
        action = policy(observation)
        observation, *rest = env.step(action)
        told.append(copy.deepcopy({"a": action, "o": observation, **dict(enumerate(rest))}))
    return observation, dict(enumerate(told))


def plays_on(name, policy, arguments):
    """Return where two copies and their original first differ from a play that nobody copied."""
    found = []
    for copies in (False, True):
        env = gymnasium.make(name, disable_env_checker=True, budget=0.05, **arguments)
        both = env, care_sim.make_policy(policy, env)
        observation, _ = env.reset(seed=3)
        both[1].reset()
        middle, _ = play(*both, observation, 3)
        takes = (copy.deepcopy(both), pickle.loads(pickle.dumps(both))) if copies else ()
        # The copies first: the original must not feel them.
        for one in (*takes, both):
            found.append(play(*one, middle, 5)[1])
            one[0].close()
    return [difference(one, found[0]) for one in found[1:]]


@pytest.mark.parametrize(("name", "policy", "arguments"), CASES, ids=[name for name, *_ in CASES])
def test_a_copy_and_the_original_play_on_as_if_alone(name, policy, arguments, drive):
    if name == "CARE-Replay-v0":
        arguments = arguments | {"source": f"argoverse2:{drive}"}
    with few_and_short():
        assert plays_on(name, policy, arguments) == [None] * 3


def torchscript(tmp_path):
    pytest.importorskip("torch")
    return {"detector": "torchscript"} | given(middle_script(tmp_path / "middle.pt"))


def torchscript_that_counts(tmp_path):
    pytest.importorskip("torch")
    return {"detector": "torchscript"} | given(counting_script(tmp_path / "counting.pt"))


def onnx(tmp_path):
    pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    file = mean_onnx(tmp_path / "mean.onnx")
    return {"detector": "onnx"} | given(file, fields="x,y,z,intensity")


def a_class_that_counts(_tmp_path):
    return {"detector": "tests.perception.test_lifetimes:Counting"}


def given(file, **others):
    return {"detector_parameters": {"file": file} | others}


STATELESS = [torchscript, onnx]
REMEMBERING = [torchscript_that_counts, a_class_that_counts]


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
@pytest.mark.parametrize("made", STATELESS + REMEMBERING)
@pytest.mark.parametrize("name", ["CARE-Dartout-v0", "CARE-Street-v0"])
def test_copies_and_the_original_detect_as_if_alone(name, made, tmp_path):
    with few_and_short():
        assert plays_on(name, "care", made(tmp_path)) == [None] * 3


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
@pytest.mark.parametrize("made", REMEMBERING)
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_detector_is_copied_with_what_it_remembers(copied, made, tmp_path):
    with few_and_short(), gymnasium.make("CARE-Street-v0", **made(tmp_path)) as env:
        env.reset(seed=3)
        env.step(env.action_space.low)
        one, two = env, copied(env)
        last = [each.unwrapped.loop.keyframe(np.arange(16384)).reported for each in (one, one, two)]
        places = [each.boxes[0, 0] for each in last]
        assert places[1] > places[0] == places[2]
        # Data of the last keyframe alone is not copied.
        assert len(one.unwrapped.loop.handed) > len(copied(one).unwrapped.loop.handed) == 0


@pytest.mark.parametrize("made", STATELESS)
@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_copies_share_the_weights_and_a_pickle_opens_the_file_again(made, tmp_path):
    arguments = made(tmp_path)
    with gymnasium.make("CARE-Dartout-v0", **arguments) as env:
        network = env.unwrapped.setting.detector._detector
        assert copy.deepcopy(env).unwrapped.setting.detector._detector is network
        packed = pickle.dumps(env)
    assert pickle.loads(packed).unwrapped.setting.detector._detector is network
    lifetimes._KEPT.clear()
    again = pickle.loads(packed).unwrapped.setting.detector._detector
    assert (type(again), again is network) == (type(network), False)
    # In processes of their own, which have no network of their parent.
    worlds = gymnasium.make_vec(
        "CARE-Dartout-v0", 2, vectorization_mode="async", disable_env_checker=True, **arguments
    )
    worlds.reset(seed=[0, 0])
    first, second = worlds.step(worlds.action_space.low)[0]["tracks"]
    assert first[0, 0] >= 0
    assert (first == second).all()
    worlds.close()


class Closed:
    """A detector that holds what nobody can copy."""

    def __init__(self):
        self._file = open(__file__)  # noqa: SIM115

    def detect(self, points, sensor_height_m):
        raise NotImplementedError


@pytest.mark.parametrize("copied", [copy.deepcopy, pickle.dumps])
def test_a_detector_that_cannot_be_copied_is_named_in_one_line(copied):
    with gymnasium.make("CARE-Dartout-v0", detector=f"{__name__}:Closed") as env:
        with pytest.raises(InvalidInput) as refused:
            copied(env)
        env.unwrapped.setting.detector._detector._file.close()
    assert str(refused.value) == (
        f"detector {__name__}:Closed cannot be copied: TypeError: cannot pickle "
        "'_io.TextIOWrapper' object; set `stateless = True` if its answers depend on the arguments "
        "of `detect` alone"
    )


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_a_stateless_one_that_cannot_be_pickled_is_made_by_name(tmp_path):
    detector = PointsOnly("mine", OnnxDetector(**onnx(tmp_path)["detector_parameters"]), 1.8)
    with pytest.raises(InvalidInput, match=r"mine cannot be copied: .*; make it by name"):
        pickle.dumps(detector)


@dataclass(frozen=True)
class Tied(Dartout):
    """A person whose motion and event are a closure over the world."""

    def build(self, rng):
        world = super().build(rng)
        world.at(1.0, lambda: world.drawn.clear())
        return world


@pytest.mark.parametrize("copied", [copy.deepcopy, pickle.dumps])
def test_a_scenario_with_a_closure_over_its_world_is_refused_in_one_line(copied):
    with ScenarioEnv(scenario=Tied) as env:
        env.reset(seed=0)
        with pytest.raises(InvalidInput) as refused:
            copied(env)
    message = str(refused.value)
    assert message.startswith("scenario tests.envs.test_copies:Tied cannot be copied: Tied.build.")
    assert "(test_copies.py, line " in message
    assert "\n" not in message
