"""The files of learned weights: what is written is read back, and anything else is refused in one
line.
"""

import json
import os
import pickle
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
    assert list(weights.arrays) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert weights.arrays[name].dtype == np.float32
        np.testing.assert_array_equal(weights.arrays[name], array)


def test_weights_of_another_set_up_are_refused_in_one_line(tmp_path):
    """By its hash: another name for the same is none. What does not tell its set-up fits any."""
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


def in_the_first_form(path: Path, arrays, card, line: str) -> None:
    """Write weights as before 0.2.0, when a card named the wrappers in one line of text."""
    save_weights(path, arrays, replace(card, wrapper=None))
    with np.load(path) as file:
        entries = dict(file)
    plain = json.loads(bytes(entries["card"])) | {"wrapper": line}
    entries["card"] = np.frombuffer(json.dumps(plain, indent=1).encode(), np.uint8)
    np.savez(path, **entries)


def test_wrappers_are_plain_data_and_cards_of_the_first_form_are_still_read(tmp_path):
    card = json.loads(CARD.to_json())
    assert card["wrapper"] == {
        "action": "SectorScores",
        "azimuths": 16,
        "elevations": 2,
        "columns": 32,
        "rows": 4,
    }
    line = "SectorScores 16 x 2, GridObservation 32 x 4"
    in_the_first_form(tmp_path / "old.npz", ARRAYS, CARD, line)
    assert load_weights(tmp_path / "old.npz").card == CARD
    for other in ("GridObservation", "SectorScores 0 x 2, GridObservation 32 x 4", ""):
        in_the_first_form(tmp_path / "old.npz", ARRAYS, CARD, other)
        with pytest.raises(InvalidInput, match=r"wrapper|azimuths") as refusal:
            load_weights(tmp_path / "old.npz")
        assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("name", ["ppo-dense", "ppo-dartout"])
def test_shipped_weights_are_of_the_first_form_and_tell_the_usual_wrappers(name):
    with np.load(shipped_weights(name)) as file:
        stored = json.loads(bytes(file["card"]))["wrapper"]
    assert stored == "SectorReserve 32 x 4, GridObservation 64 x 8"
    assert load_weights(shipped_weights(name)).card.wrapper == Wrapping()


def test_the_same_weights_give_the_same_bytes(saved, tmp_path):
    save_weights(tmp_path / "again", ARRAYS, CARD)
    assert (tmp_path / "again").read_bytes() == saved.read_bytes()


def test_weights_that_fit_are_accepted(saved):
    load_weights(saved).check("learned-scorer", RIG)


def test_without_a_budget_any_will_do(tmp_path):
    save_weights(tmp_path / "w.npz", ARRAYS, replace(CARD, budget=None))
    load_weights(tmp_path / "w.npz").check("learned-scorer", Rig(budget=7))


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


def pickled(path: Path) -> None:
    np.savez(path, card=np.array([print], object))


def without_card(path: Path) -> None:
    np.savez(path, **ARRAYS)


def other_json(path: Path) -> None:
    np.savez(path, card=np.frombuffer(b'{"kind": "x"}', np.uint8))


def other(said: str, instead: str):
    """A card that says something else."""

    def spoil(path: Path) -> None:
        assert said in CARD.to_json()
        np.savez(path, card=np.frombuffer(CARD.to_json().replace(said, instead).encode(), np.uint8))

    return spoil


def large(path: Path) -> None:
    np.savez_compressed(path, card=np.zeros(1, np.uint8), weight=np.zeros(2**24 + 1, np.float32))


def squeezed(path: Path) -> None:
    """Damaged within a compressed entry."""
    np.savez_compressed(path, **ARRAYS, card=np.frombuffer(CARD.to_json().encode(), np.uint8))
    content = bytearray(path.read_bytes())
    start = content.index(b"weight.npy") + 30
    content[start : start + 8] = b"\xff" * 8
    path.write_bytes(content)


def broken_header(path: Path) -> None:
    save_weights(path, ARRAYS, CARD)
    path.write_bytes(path.read_bytes().replace(b"{'descr'", b"{'descr(", 1))


def locked(path: Path) -> None:
    """Marked as encrypted."""
    save_weights(path, ARRAYS, CARD)
    content = bytearray(path.read_bytes())
    for signature, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(signature) + flags] |= 1
    path.write_bytes(content)


def doubles(path: Path) -> None:
    save_weights(path, {}, CARD)
    card = np.load(path)["card"]
    np.savez(path, card=card, weight=np.zeros(3))


def _card_bytes():
    return np.frombuffer(CARD.to_json().encode(), np.uint8)


def not_finite(path: Path) -> None:
    np.savez(path, card=_card_bytes(), weight=np.array([np.nan], np.float32))


def too_large(path: Path) -> None:
    np.savez(path, card=_card_bytes(), weight=np.float32([0, -1.01 * LARGEST_WEIGHT]))


def cut(path: Path) -> None:
    save_weights(path, ARRAYS, CARD)
    path.write_bytes(path.read_bytes()[:-40])


def flipped(path: Path) -> None:
    save_weights(path, ARRAYS, CARD)
    content = bytearray(path.read_bytes())
    content[content.index(ARRAYS["weight"].tobytes())] ^= 1
    path.write_bytes(content)


def one_array(path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, np.zeros(3))


@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.write_text("hello"),
        lambda path: path.write_bytes(b""),
        lambda path: path.write_bytes(pickle.dumps(print)),
        lambda path: path.mkdir(),
        os.mkfifo,
        one_array,
        pickled,
        without_card,
        other_json,
        other('"steps"', '"stepz"'),
        other('"budget": 492', '"budget": "x"'),
        other('"budget": 492', '"budget": true'),
        other('"budget": 492', '"budget": 1' + 400 * "0"),
        other('"columns": 512', '"columns": "x"'),
        other('"columns": 512', '"column": 512'),
        other('"steps": 0', '"steps": "x"'),
        other('"azimuths": 16', '"azimuths": 16.0'),
        other('"azimuths": 16', '"azimuths": 3'),
        other('"azimuths": 16', '"sectors": 16'),
        other('"action": "SectorScores"', '"action": "Scores"'),
        large,
        squeezed,
        broken_header,
        locked,
        doubles,
        not_finite,
        too_large,
        cut,
        flipped,
    ],
)
def test_anything_else_is_refused_in_one_line(tmp_path, spoil):
    path = tmp_path / "spoilt.npz"
    spoil(path)
    with pytest.raises(
        InvalidInput, match=r"spoilt\.npz: no \.npz of weights .*, or damaged"
    ) as refusal:
        load_weights(path)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda path: path.write_text("hello"), "it is no whole archive"),
        (one_array, "it is no whole archive"),
        (cut, "it is no whole archive"),
        (os.mkfifo, "it is no file"),
    ],
)
def test_what_is_no_archive_is_called_so(tmp_path, spoil, reason):
    spoil(tmp_path / "w.npz")
    with pytest.raises(InvalidInput, match=rf"\({reason}\)$"):
        load_weights(tmp_path / "w.npz")


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


def test_what_would_run_when_it_is_unpickled_does_not_run(tmp_path):
    card = np.frombuffer(CARD.to_json().encode(), np.uint8)
    sprung = tmp_path / "sprung"
    np.savez(tmp_path / "w.npz", card=card, weight=np.array([Trap(sprung)], object))
    with pytest.raises(InvalidInput, match="allow_pickle=False"):
        load_weights(tmp_path / "w.npz")
    assert not sprung.exists()


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InvalidInput, match=r"nowhere\.npz: no such file"):
        load_weights(tmp_path / "nowhere.npz")


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
