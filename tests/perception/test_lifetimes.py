"""How long detectors live: a stateless one as long as its process, any other for one play."""

import os
import signal
from concurrent.futures import ThreadPoolExecutor
from threading import Event, Thread

import gymnasium
import numpy as np
import pytest

from care_sim.core.types import CLASSES, Detections
from care_sim.perception import lifetimes
from care_sim.perception.detectors import make_detector
from care_sim.sensors.annotated import NO_ANNOTATIONS, NO_OBJECT, Cloud
from care_sim.sources.named import source_of
from care_sim.sources.scenes import Streets
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.executors import processes
from care_sim.study.play_config import play_grid
from care_sim.study.scene_play import play_scene
from tests.helpers.network_files import counting_script
from tests.helpers.short_streets import few_and_short
from tests.helpers.vectors import difference

HERE = __name__
CLOUD = Cloud(np.array([3]), np.array([[10.0, 2.0, -1.0]]), np.array([NO_OBJECT]))


class Counting:
    """A pedestrian who is the farther away, the more often the detector was called, and who is gone
    after the `last` call.
    """

    made = 0

    def __init__(self, file="", step_m=1.0, last=1000, anything=None):
        type(self).made += 1
        self._last = last
        self._step_m = step_m
        self.calls = 0

    def detect(self, points, sensor_height_m):
        self.calls += 1
        if self.calls > self._last:
            return Detections([], [], [])
        box = [5.0 + self._step_m * self.calls, 0, -1, 4, 4, 4, 0]
        return Detections([CLASSES.index("pedestrian")], [box], [0], [1.0])


class Shared(Counting):
    """Says so, and is none."""

    made = 0
    stateless = True


def shared(**parameters):
    return make_detector(f"{HERE}:Shared", 1.8, **parameters)._detector


def test_a_stateless_detector_is_made_once_per_set_of_parameters(tmp_path):
    file = tmp_path / "net.pt"
    file.write_bytes(b"one")
    first = shared(file=file)
    Shared.made = 0
    assert shared(file=file) is first
    assert make_detector(f"{HERE}:Shared", 0.4, track_score=0.5, file=file)._detector is first
    with ThreadPoolExecutor(4) as pool:
        assert len(set(pool.map(lambda _: shared(step_m=7.0), range(8)))) == 1
    assert Shared.made == 1
    assert len({shared(anything=value) for value in (1, True, 1.0, "1", [1], None)}) == 6
    # Detectors whose parameters cannot be compared are not kept.
    assert shared(anything=np.ones(2)) is not shared(anything=np.ones(2))
    file.write_bytes(b"another")
    assert shared(file=file) is not first
    for step in range(lifetimes.MOST_KEPT):
        shared(step_m=float(step))
    assert len(lifetimes._KEPT) == lifetimes.MOST_KEPT


def test_a_change_of_any_file_that_it_reads_makes_it_anew(tmp_path):
    folder, declared, base = tmp_path / "weights", tmp_path / "declared", tmp_path / "base"
    folder.mkdir()
    for file in (folder / "w", declared, base):
        file.write_text("one")

    def made():
        detector = Shared()
        detector.files = [base]
        return detector

    def kept():
        return lifetimes.get_or_make(Shared, {"file": folder}, made, [declared])

    for file in (folder / "w", declared, base):
        first = kept()
        assert kept() is first
        file.write_text("another")
        assert kept() is not first


def test_a_row_has_another_hash_after_a_file_of_its_detector_changed(tmp_path):
    file = tmp_path / "base.txt"
    parameters = {"detector": f"{HERE}:Based", "detector_parameters": (("base", str(file)[:-4]),)}
    found = set()
    for text in ("one", "another", "one"):
        file.write_text(text)
        (play,) = play_grid(Streets(), Streets().scenes()[:1], ["care"], [0.1], **parameters)
        found.add(play.digest())
        found.add(EpisodeConfig("dartout", "care", 0.1, 0, **parameters).digest())
    assert len(found) == 4


class Based(Shared):
    """Reads a file whose name no parameter has."""

    def __init__(self, base):
        super().__init__()
        self.files = (f"{base}.txt",)


def test_a_forked_child_makes_its_own_whatever_its_parent_did():
    shared()
    held, done = Event(), Event()

    def hold():
        with lifetimes._LOCK:
            held.set()
            done.wait()

    thread = Thread(target=hold)
    thread.start()
    held.wait()
    child = os.fork()
    if not child:
        # A child that waits for a lock of its parent ends by this.
        signal.alarm(5)
        Shared.made = 0
        shared()
        os._exit(Shared.made)
    done.set()
    thread.join()
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 1


def test_any_other_is_made_anew(tmp_path):
    one, two = (make_detector(f"{HERE}:Counting", 1.8) for _ in range(2))
    for _ in range(2):
        places = [each.detect(CLOUD, NO_ANNOTATIONS)[0].boxes[0, 0] for each in (one, two)]
    assert places == [7.0, 7.0]
    rig = gymnasium.make("care_sim:CARE-Dartout-v0").unwrapped.rig
    seed = np.random.SeedSequence(0)
    fresh = one.begin(seed, rig, is_filmed=True)
    assert fresh.begin(seed, rig, is_filmed=True) is fresh
    assert fresh.detect(CLOUD, NO_ANNOTATIONS)[0].boxes[0, 0] == 6.0


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_a_torchscript_module_that_writes_to_itself_is_not_shared(tmp_path):
    pytest.importorskip("torch")
    file = counting_script(tmp_path / "counting.pt")
    for _ in range(2):
        detector = make_detector("torchscript", 1.8, file=file)
        assert detector.detect(CLOUD, NO_ANNOTATIONS)[0].boxes[0, 0] == 6.0


EPISODES = [
    ("CARE-Dartout-v0", 30, {"false_positive_rate": 0.9}),
    ("CARE-Street-v0", 4, {}),
]


@pytest.mark.parametrize(("name", "steps", "arguments"), EPISODES)
def test_an_episode_is_the_same_whatever_was_played_before(name, steps, arguments):
    with few_and_short():
        env = gymnasium.make(
            f"care_sim:{name}",
            disable_env_checker=True,
            detector=f"{HERE}:Counting",
            # The car brakes at first alone, also on the drive that false boxes are taken from.
            detector_parameters={"step_m": 0.1, "last": 9},
            **arguments,
        )
        found = []
        for seed in (3, 4, 3):
            told = [env.reset(seed=seed)]
            told += [env.step(env.action_space.low) for _ in range(steps)]
            found.append(dict(enumerate(dict(enumerate(each)) for each in told)))
        env.close()
    assert difference(found[0], found[2]) is None
    assert difference(found[0], found[1]) is not None


def plays(drive, detector):
    source = source_of(f"argoverse2:{drive}")
    named = {"detector": f"{HERE}:{detector}"}
    return play_grid(source, source.scenes(), ["random", "full"], [0.05], **named)


def hashes(rows):
    return sorted(row["episode_hash"] for each in rows for row in each)


def test_plays_are_the_same_in_any_order_with_one_worker_and_with_two(drive):
    batch = plays(drive, "Counting")
    found = hashes([play_scene(batch)])
    assert hashes([play_scene(batch[::-1])]) == found
    for workers in (1, 2):
        with processes(workers) as pool:
            assert hashes(pool.map(play_scene, [[play] for play in batch])) == found
    # A detector that promises too much shows that this could fail.
    batch = plays(drive, "Shared")
    assert hashes([play_scene(batch)]) != hashes([play_scene(batch[::-1])])
