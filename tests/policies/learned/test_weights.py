"""The files of learned weights: what is written is read back, and anything else is refused in one
line.
"""

import json
import os
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.array_files import LARGEST_WEIGHT
from care_sim.base.errors import InvalidInput
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig
from care_sim.core.sensor_setup import SensorSetup
from care_sim.policies.learned.weights import (
    Card,
    Wrapping,
    load_weights,
    save_weights,
    shipped_weights,
)

ARRAYS = {"weight": np.arange(6, dtype=np.float32).reshape(2, 3), "bias": np.zeros(3, np.float32)}
CARD = Card(
    "learned-scorer",
    AngularGrid(),
    budget=492,
    wrapper=Wrapping("SectorScores", 16, 2, 32, 4),
    seeds={"train": [1]},
)
RIG = Rig(budget=492)
SHIPPED = {"learned-scorer": shipped_weights("learned-scorer"), "ppo": shipped_weights("ppo-dense")}


@pytest.fixture
def saved(tmp_path):
    save_weights(tmp_path / "w.npz", ARRAYS, CARD)
    return tmp_path / "w.npz"


def test_what_is_written_is_read_back_bit_for_bit(saved):
    weights = load_weights(saved)
    assert weights.card == CARD
    save_weights(saved.with_name("again.npz"), ARRAYS, CARD)
    assert saved.with_name("again.npz").read_bytes() == saved.read_bytes()
    weights.check("learned-scorer", RIG)
    replace(weights, card=replace(CARD, budget=None)).check("learned-scorer", Rig(budget=7))
    assert list(weights.arrays) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert weights.arrays[name].dtype == np.float32
        np.testing.assert_array_equal(weights.arrays[name], array)


def test_weights_of_another_set_up_are_refused_in_one_line(tmp_path):
    """By its hash: another name for the same is none. Weights that do not name their set-up fit
    any.
    """
    bumper = SensorSetup("bumper", position=(2.0, 0.0, 0.6))
    card = Card("ppo", AngularGrid(), setup=bumper.label)
    save_weights(tmp_path / "w.npz", ARRAYS, card)
    weights = load_weights(tmp_path / "w.npz")
    assert weights.card.setup == f"bumper {bumper.digest}"
    for setup in (bumper.label, f"another name {bumper.digest}", ""):
        weights.check("ppo", Rig(setup=setup))
    replace(weights, card=replace(card, setup="")).check("ppo", Rig(setup="roof 123"))
    with pytest.raises(InvalidInput, match=r"the set-up is bumper \w+, needed is roof 123$"):
        weights.check("ppo", Rig(setup="roof 123"))


@pytest.mark.parametrize("environment", ["CARE-Dense-v0", "CARE-Street-v0"])
def test_an_environment_tells_its_set_up(environment, tmp_path):
    """The map of `place` from the bumper is none for the roof, though both have one grid."""
    bumper = SensorSetup("bumper", position=(2.0, 0.0, 0.6))
    arrays = {"sightings": np.zeros(AngularGrid().shape)}
    save_weights(tmp_path / "w.npz", arrays, Card("place", AngularGrid(), setup=bumper.label))
    with gymnasium.make(environment, sensor=bumper) as env:
        care_sim.make_policy("place", env, path=tmp_path / "w.npz")
    with (
        gymnasium.make(environment) as env,
        pytest.raises(InvalidInput, match=r"the set-up is bumper \w+, needed is hdl-32e \w+$"),
    ):
        care_sim.make_policy("place", env, path=tmp_path / "w.npz")


@pytest.mark.parametrize(
    ("kind", "rig", "message"),
    [
        ("ppo", RIG, "kind is 'learned-scorer', needed is 'ppo'"),
        (
            "learned-scorer",
            Rig(budget=1638),
            r"budget is 492 cells \(0.03003\), needed is 1638 cells \(0.09998\)",
        ),
        (
            "learned-scorer",
            Rig(AngularGrid(columns=256), budget=492),
            "grid is columns 512 rows 32 .*, needed is columns 256",
        ),
        ("learned-scorer", Rig(AngularGrid(top=0.2), budget=492), "grid is .*needed is .*top 0.2 "),
    ],
)
def test_weights_that_do_not_fit_are_refused_with_what_they_are(saved, kind, rig, message):
    with pytest.raises(InvalidInput, match=f"w.npz: {message}") as refusal:
        load_weights(saved).check(kind, rig)
    assert "\n" not in str(refusal.value)


class Trap:
    """Makes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


CARD_BYTES = np.frombuffer(CARD.to_json().encode(), np.uint8)


def other(said: str, instead: str):
    """A card that says something else."""

    def spoil(path: Path) -> None:
        assert said in CARD.to_json()
        np.savez(path, card=np.frombuffer(CARD.to_json().replace(said, instead).encode(), np.uint8))

    return spoil


def of(**entries):
    """An archive of a right card and these entries."""
    return lambda path: np.savez(path, **{"card": CARD_BYTES} | entries)


def changed(change):
    """A right file of which bytes were changed."""

    def spoil(path: Path) -> None:
        save_weights(path, ARRAYS, CARD)
        path.write_bytes(bytes(change(bytearray(path.read_bytes()))))

    return spoil


def flipped(content):
    content[content.index(ARRAYS["weight"].tobytes())] ^= 1
    return content


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda path: path.write_text("hello"), "it is no whole archive"),
        (changed(lambda content: content[:-40]), "it is no whole archive"),
        (os.mkfifo, "it is no file"),
        (lambda path: np.savez(path, **ARRAYS), "card"),
        (of(card=np.frombuffer(b'{"kind": "x"}', np.uint8)), "its card is not of the format"),
        (other('"steps"', '"stepz"'), "lacks or has too much: steps, stepz"),
        (other('"budget": 492', '"budget": true'), "budget True"),
        (other('"budget": 492', '"budget": 1' + 400 * "0"), "budget 1000"),
        (other('"columns": 512', '"columns": "x"'), "grid"),
        (other('"columns": 512', '"column": 512'), "grid"),
        (other('"azimuths": 16', '"azimuths": 3'), "azimuths"),
        (other('"azimuths": 16', '"sectors": 16'), ""),
        (other('"action": "SectorScores"', '"action": "Scores"'), "action"),
        (of(weight=np.zeros(2**24 + 1, np.float32)), ""),
        (of(weight=np.zeros(3)), "array 'weight'"),
        (of(weight=np.array([np.nan], np.float32)), "array 'weight' is not of finite"),
        (of(weight=np.float32([0, -1.01 * LARGEST_WEIGHT])), "array 'weight'"),
        (changed(flipped), "CRC"),
        (changed(lambda content: content.replace(b"{'descr'", b"{'descr(", 1)), ""),
    ],
)
def test_anything_else_is_refused_in_one_line(tmp_path, spoil, reason):
    path = tmp_path / "spoilt.npz"
    spoil(path)
    with pytest.raises(
        InvalidInput, match=r"spoilt\.npz: no \.npz of weights .*, or damaged"
    ) as refusal:
        load_weights(path)
    assert "\n" not in str(refusal.value)
    assert reason in str(refusal.value)


def test_what_would_run_when_it_is_unpickled_does_not_run(tmp_path):
    sprung = tmp_path / "sprung"
    of(weight=np.array([Trap(sprung)], object))(tmp_path / "w.npz")
    with pytest.raises(InvalidInput, match="allow_pickle=False"):
        load_weights(tmp_path / "w.npz")
    assert not sprung.exists()


@pytest.mark.parametrize("name", ["ppo-dense", "ppo-dartout"])
def test_cards_of_the_first_form_name_wrappers_in_a_line(name):
    with np.load(shipped_weights(name)) as file:
        stored = json.loads(bytes(file["card"]))["wrapper"]
    assert stored == "SectorReserve 32 x 4, GridObservation 64 x 8"
    assert load_weights(shipped_weights(name)).card.wrapper == Wrapping()


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("largest", [LARGEST_WEIGHT, -LARGEST_WEIGHT])
@pytest.mark.parametrize("name", ["learned-scorer", "ppo"])
def test_the_largest_weights_overflow_nowhere(tmp_path, name, largest):
    arrays = {n: np.full_like(a, largest) for n, a in load_weights(SHIPPED[name]).arrays.items()}
    card = load_weights(SHIPPED[name]).card
    save_weights(tmp_path / "w.npz", arrays, card)
    with gymnasium.make("CARE-Dartout-v0", budget=0.03, disable_env_checker=True) as env:
        policy = care_sim.make_policy(name, env, path=str(tmp_path / "w.npz"))
        observation, _ = env.reset(seed=0)
        for _ in range(3):
            observation, *_ = env.step(policy(observation))


def test_arrays_are_taken_by_name_and_shape(saved):
    weights = load_weights(saved)
    assert weights.array("weight", 2, None) is weights.arrays["weight"]
    with pytest.raises(InvalidInput, match=r"'weight' has the shape \(2, 3\), needed is any x 4"):
        weights.array("weight", None, 4)
    with pytest.raises(InvalidInput, match="no array 'gain'; it has weight, bias"):
        weights.array("gain")


@pytest.mark.parametrize(
    "grid",
    [
        AngularGrid(columns=120, field_of_view=np.deg2rad(120.0), heading=0.5),
        AngularGrid.of_elevations([0.1, 0.05, -0.3]),
    ],
)
def test_a_card_tells_of_any_grid(tmp_path, grid):
    save_weights(tmp_path / "w.npz", {}, Card("ppo", grid))
    weights = load_weights(tmp_path / "w.npz")
    assert weights.card.grid == grid
    weights.check("ppo", Rig(grid))
    with pytest.raises(InvalidInput, match=r"grid is .*, needed is "):
        weights.check("ppo", Rig())
