"""Training on the scenes of a source: which scenes, what they teach, and what the card says."""

import json
import shlex
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.cli import parsed_command
from care_sim.core.types import CLASSES
from care_sim.envs.open_loop import FilmEnv
from care_sim.perception.pillars.detector import load_detector
from care_sim.policies.learned.weights import load_weights
from care_sim.sources.named import source_of
from care_sim.sources.recordings import Recordings
from care_sim.sources.scenes import Scene, film_of
from care_sim.training.supervised import (
    detector,
    detector_data,
    recorded,
    scorer,
    sets_data,
    worlds,
)
from care_sim.training.supervised.recorded import MOST_HELD_OUT, SCENES_KEPT, Scenes, parted
from care_sim.training.supervised.scorer import OTHER_CELLS
from tests.helpers.commands import run
from tests.helpers.handmade_film import AHEAD, BUS, WALKER, box_of, handmade_film, returns_of
from tests.helpers.nuscenes_drive import write_drive

DOWNHILL_M = 6.0


@dataclass(frozen=True)
class Handmade(Recordings):
    """Two films made by hand. In `hill` all lies below the road at the car, and beside the rays."""

    licence = "for tests alone"

    def scenes(self):
        return ["flat", "hill"]

    def film(self, scene):
        film = handmade_film(4)
        below = np.array([0.0, 0.0, -DOWNHILL_M]) * (scene == "hill")

        def moved(shot):
            boxes = shot.annotations.boxes + np.array([*below, 0, 0, 0, 0])
            cloud = replace(shot.cloud, points=shot.cloud.points + below + 0.01)
            return replace(shot, annotations=replace(shot.annotations, boxes=boxes), cloud=cloud)

        return replace(film, name=scene, shots=tuple(map(moved, film.shots)))


@pytest.fixture
def source(tmp_path):
    return source_of(f"{__name__}:Handmade:{tmp_path}")


def names(of):
    return [world.film.args[1].name for world in of]


class Numbered:
    """A source of numbered scenes, each its own log or one of `logs`."""

    kind, sensor = "streets", "hdl-32e"

    def __init__(self, logs=None):
        self.logs = logs or {}

    def row(self, scene):
        return {}

    def log(self, scene):
        return self.logs.get(scene.name, scene.name)


def scenes_of(numbers):
    return [Scene(f"scene-{number:04}", 0) for number in numbers]


@given(st.integers(2, 900))
def test_no_scene_is_learned_from_and_held_out_and_none_is_lost(count):
    every = scenes_of(range(count))
    learned, held_out = parted(Numbered(), every)
    assert [*learned, *held_out] == every
    assert len(held_out) == min(MOST_HELD_OUT, -(-count // 5))
    parts = Scenes(Numbered(), learned, held_out)
    turns = names(islice(parts.endless(), 2 * len(learned)))
    for turn in (turns[: len(learned)], turns[len(learned) :]):
        assert sorted(turn) == [scene.name for scene in learned]
    # However many scenes, what is kept of them fits into memory.
    made = parts.worlds(learned)
    assert sum(world.share for world in made) <= SCENES_KEPT + 1e-6
    assert len({world.seed for world in made}) == len(made)


@example([0] + 9 * [1])
@given(st.lists(st.integers(0, 30), min_size=2, max_size=300))
def test_no_log_is_learned_from_and_held_out(logs):
    every = scenes_of(range(len(logs)))
    log_of = {scene.name: str(log) for scene, log in zip(every, logs, strict=True)}
    learned, held_out = parted(Numbered(log_of), every)
    assert learned
    assert 1 <= len(held_out) <= MOST_HELD_OUT
    if len({*logs}) > 1:
        assert not {log_of[scene.name] for scene in learned} & {
            log_of[scene.name] for scene in held_out
        }
    else:
        assert [*learned, *held_out] == every


def test_a_log_in_both_parts_is_told(tmp_path, capsys):
    root = write_drive(tmp_path / "nuscenes")
    source = source_of(f"nuscenes:{root}")
    first, second = source.scenes()
    for named in ([[first, second]], [[first], [second]]):
        assert parted(source, *named) == ((first,), (second,))
        assert "logs with scenes in both parts: 1, such as 'log'" in capsys.readouterr().err
    (table,) = root.glob("*/scene.json")
    rows = json.loads(table.read_text())
    rows[0]["log_token"] = "another"
    del rows[1]["log_token"]
    table.write_text(json.dumps(rows))
    assert [source.log(scene) for scene in (first, second)] == ["another", "scene-0916"]
    parted(source, [first, second])
    assert not capsys.readouterr().err


@given(st.sets(st.integers(0, 60), min_size=1), st.sets(st.integers(0, 60), min_size=1))
def test_two_splits_must_share_no_scene(one, other):
    first, second = scenes_of(sorted(one)), scenes_of(sorted(other))
    if one & other:
        with pytest.raises(InvalidInput, match="must share none"):
            parted(Numbered(), first, second)
        return
    learned, held_out = parted(Numbered(), first, second)
    assert [*learned] == first
    assert {*held_out} <= {*second}
    assert (held_out[0], held_out[-1]) == (second[0], second[-1])


def test_the_scorer_learns_what_stands_in_the_scenes(source):
    """At the first keyframe the car ahead is new, and the bus still farther than 50 m."""
    scenes = Scenes(source, *[source.scenes()] * 2)
    assert scenes.told["terms"].endswith("licence of the recordings: for tests alone")
    (world, _) = scenes.worlds(source.scenes())
    plays = [*scorer.examples(world)]
    # Three budgets with all cameras, and with the front one.
    assert len(plays) == 6
    news = len(returns_of(AHEAD, 0)) + len(returns_of(WALKER, 1))
    for play in plays[2::3]:
        # At 35% everything is found at once, so later keyframes teach what is new there alone.
        assert play.positive.sum() >= news
    rng = np.random.default_rng(0)
    (env, *_) = worlds.plays(world, rng, faulty=False)
    env.reset(seed=0)
    cells, weights = scorer.untracked_cells(env.loop)
    assert np.array_equal(cells, np.sort(returns_of(AHEAD, 0)))
    assert weights.sum() == pytest.approx(1)


def test_a_share_of_the_keyframes_is_kept(source):
    (world, _) = Scenes(source, *[source.scenes()] * 2).worlds(source.scenes())
    whole, none = (
        sum((~part.positive).sum() for part in scorer.examples(world._replace(share=share)))
        for share in (1.0, 0.0)
    )
    assert none == 0
    assert whole > 6 * 4 * OTHER_CELLS * 0.9
    assert len(sets_data.play(world, None)) == 8 * 4
    assert not sets_data.play(world._replace(share=0.0), None)


@pytest.mark.parametrize("scene", ["flat", "hill"])
def test_the_detector_learns_from_the_points_that_it_would_be_handed(source, scene, monkeypatch):
    """Recorded points stay where they were measured, and who has one is an object, also where the
    road falls.
    """
    monkeypatch.setattr(detector_data, "_conditions", lambda rng, clutter: {"budget": 1.0})
    monkeypatch.setattr(detector_data, "SHARE_KEPT", 1)
    (at,) = (row for row, one in enumerate(source.scenes()) if one.name == scene)
    world = Scenes(source, *[source.scenes()] * 2).worlds(source.scenes())[at]
    shots = source.film(source.scenes()[at]).shots
    made = detector_data.play(world)
    assert len(made) == 3 * (len(shots) - 1)
    for one, shot in zip(made[:3], shots[:3], strict=True):
        assert one.full
        assert one.points == pytest.approx(shot.cloud.points, abs=1e-5)
        assert np.array_equal(one.classes, shot.annotations.classes)
        assert np.array_equal(one.boxes, shot.annotations.boxes)


def test_who_got_no_ray_is_no_object_of_the_scan(source):
    with closing(FilmEnv(source.film(source.scenes()[0]), budget=0.1, floor=False)) as env:
        env.reset(seed=0)
        present = detector_data._present(env)
        action = np.zeros(env.rig.grid.size, np.float32)
        action[returns_of(AHEAD, 0)[:1]] = 1
        env.step(action.reshape(env.rig.grid.shape))
        one = detector_data._detector_input(env, None, present, False)
    assert present.objects.tolist() == [AHEAD, BUS]
    assert len(one.points) == 1
    assert one.classes.tolist() == [CLASSES.index("car")]
    assert np.array_equal(one.boxes, [box_of(AHEAD, 0)])


torch = pytest.importorskip("torch")
KINDS = ("learned-scorer", "learned-sets", "detector")


def card_of(kind, path):
    if kind == "detector":
        return load_detector(path)[1]
    return json.loads(load_weights(path).card.to_json())


def trained(monkeypatch, capsys, kind, out, *words):
    monkeypatch.setattr(detector, "processes", ThreadPoolExecutor)
    monkeypatch.setattr(detector, "SHUFFLED", 6)
    return run(capsys, "train", kind, "--steps", 2, "--out", out, *words)


@pytest.mark.parametrize("kind", KINDS)
def test_nuscenes_teaches_and_the_card_says_what_it_was(kind, tmp_path, monkeypatch, capsys):
    root, out = write_drive(tmp_path / "nuscenes"), tmp_path / "w.npz"
    words = ("--source", f"nuscenes:{root}", "--split", "val")
    played = []

    def watched(source, scene):
        played.append(scene.name)
        return film_of(source, scene)

    monkeypatch.setattr(recorded, "film_of", watched)
    code, told, complaints = trained(monkeypatch, capsys, kind, out, *words)
    assert code == 0, complaints
    # First what is learned from alone, then what is held out alone.
    assert [*dict.fromkeys(played)] == ["scene-0103", "scene-0916"]
    assert played == sorted(played)
    assert "the split val of nuscenes is published for the paper's tables" in complaints
    card = card_of(kind, out)
    assert "nuscenes, 1 scene learned from, split val, digest " in card["data"]
    assert "1 scene held out, split val" in card["data"]
    assert "licence of the recordings: CC BY-NC-SA 4.0, not for commercial use" in card["data"]
    assert str(tmp_path) not in json.dumps(card)
    assert card["seeds"] == {
        "scenes learned from": ["scene-0103"],
        "scenes held out": ["scene-0916"],
        "training": 0,
    }
    assert all(np.isfinite(value) for value in card["result"].values())
    # The line at the end plays the weights on the scene that was held out.
    (line,) = (one for one in told.splitlines() if one.startswith("play it: care-sim "))
    _, play = parsed_command(shlex.split(line)[3:])
    assert play.source == f"nuscenes:{root}"
    assert (play.split, play.scenes) == ("val", ("scene-0916",))
    assert str(out) in f"{play.policy_parameters} {play.detector_parameters}"


def test_few_held_out_scenes_are_played_often_and_no_play_is_fitted_and_judged(source):
    for held_out in (source.scenes()[:1], source.scenes()):
        fitted, judged = detector._held_out(Scenes(source, (source.scenes()[0],), (*held_out,)))
        assert len(fitted) == len(judged) == detector.LEAST_CHECKED
        assert len({world.seed for world in (*fitted, *judged)}) == 2 * detector.LEAST_CHECKED
        assert {*names(fitted)} == {"flat"}
        assert {*names(judged)} == {held_out[-1].name}


def test_other_files_have_another_digest_wherever_they_lie(tmp_path):
    told = []
    for folder in ("one", "same", "other"):
        root = write_drive(tmp_path / folder)
        if folder == "other":
            sweep = min(root.rglob("*.bin"))
            sweep.write_bytes(np.fromfile(sweep, np.float32)[5:].tobytes())
        source = source_of(f"nuscenes:{root}", split="val")
        told.append(Scenes(source, *parted(source, source.scenes())).told["data"])
    assert told[0] == told[1] != told[2]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("--split train", "--split has no meaning without --source"),
        ("--scenes 3", "--scenes has no meaning without --source"),
        ("--source boreas", "boreas has one scene here, 'boreas-objects-v1'; training needs two"),
        ("--source boreas --split train", "split has no meaning for boreas recordings"),
        ("--source nuscenes:ROOT --split train", "holds no scene of the split 'train'"),
        ("--source nuscenes:ROOT --split val --scenes 1", "has one scene here, 'scene-0103'"),
        (
            "--source nuscenes:ROOT --split val --validation-split all",
            "2 scenes are learned from and held out",
        ),
        (
            "--source nuscenes:ROOT --split val --validation-split mini_vla",
            "unknown split 'mini_vla'",
        ),
        ("--source nuscenes:ROOT", "source nuscenes has several splits: pass --split"),
        ("--source streets", "source streets has several splits: pass --split"),
        ("--source nuscene:ROOT", "unknown source"),
    ],
)
def test_what_cannot_be_learned_from_is_refused_in_a_line(words, complaint, tmp_path, capsys):
    root = write_drive(tmp_path / "nuscenes")
    given = words.replace("ROOT", str(root)).split()
    code, out, err = run(capsys, "train", "learned-sets", "--out", tmp_path / "w.npz", *given)
    assert (code, out) == (2, "")
    assert complaint in err.splitlines()[-1]
    assert not (tmp_path / "w.npz").exists()


def test_weights_of_recordings_say_that_they_need_a_source(tmp_path, monkeypatch, capsys):
    root, out = write_drive(tmp_path / "nuscenes"), tmp_path / "w.npz"
    source = "--source", f"nuscenes:{root}", "--split", "val"
    trained(monkeypatch, capsys, "learned-scorer", out, *source)
    code, _, err = run(capsys, "run", out)
    assert code == 2
    assert "learned from recordings: name a source by --scenario" in err
    assert run(capsys, "run", out, "--scenario", f"nuscenes:{root}")[0] == 0


def test_weights_of_streets_play_on_streets(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(scorer, "SCORER_BUDGETS", (0.1,))
    out, words = tmp_path / "w.npz", ("--source", "streets", "--split", "evaluation")
    code, _, told = trained(monkeypatch, capsys, "learned-scorer", out, *words, "--scenes", 2)
    assert code == 0, told
    assert "the split evaluation of streets is published for" in told
    assert run(capsys, "run", out)[0] == 0
