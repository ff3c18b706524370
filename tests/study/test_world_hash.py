"""A scenario that draws outside its seed is refused: policies would play in different worlds."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import count

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.commands.compare import play_side_by_side
from care_sim.commands.shared.run_study import run_study
from care_sim.reports.merging import merged
from care_sim.scenarios.dartout import Dartout
from care_sim.study.episode_config import grid
from care_sim.study.episode_play import run_episode
from care_sim.study.rows.checks import check_worlds
from care_sim.world.bodies import CATALOGUE
from care_sim.world.motions import Walk

_BUILT = count()
# Without processes, whose start takes seconds.
studied = partial(run_study, workers=1, make_executor=ThreadPoolExecutor)


@dataclass(frozen=True)
class Sound(Dartout):
    """Draws from its seed alone."""

    duration_s: float = 0.5

    def pace(self, rng):
        return rng.uniform(1.0, 2.0)

    def build(self, rng):
        world = super().build(rng)
        walk = Walk((20.0, 7.0), 0.0, self.pace(rng), 100.0, 9.0, starts_s=0.1)
        world.add("jogger", "pedestrian", walk.pose)
        return world


@dataclass(frozen=True)
class Drawing(Sound):
    """Draws from the system, how fast somebody goes who stands at first."""

    def pace(self, rng):
        return np.random.default_rng().uniform(1.0, 2.0)


@dataclass(frozen=True)
class Counting(Sound):
    """Counts the worlds that were built."""

    def pace(self, rng):
        return 1.0 + next(_BUILT)


@dataclass(frozen=True)
class Shaping(Sound):
    """Counts in a part of a body, whose size stays as it is."""

    def build(self, rng):
        world = super().build(rng)
        hedge = CATALOGUE["hedge"]
        parts = tuple(replace(p, size=(1.0, 0.5, 1.0 + 0.01 * next(_BUILT))) for p in hedge.parts)
        world.add("hedge", replace(hedge, parts=parts), (20.0, 5.0, 0.0))
        return world


class Startled:
    """Jumps, as the system draws, when the car brakes."""

    y = 9.0

    def look(self, world):
        if world.ego_motion.acceleration < 0:
            self.y += np.random.default_rng().uniform(0.0, 1.0)

    def pose(self, _time):
        return 20.0, self.y, 0.0


@dataclass(frozen=True)
class Reacting(Sound):
    """Draws from the system what somebody does when the car brakes."""

    def build(self, rng):
        world = super().build(rng)
        startled = Startled()
        world.add("startled", "pedestrian", startled.pose)
        world.at_every_step(startled.look)
        return world


def plays(kind, policies=("history", "care"), seeds=(0, 1)):
    return grid([f"tests.study.test_world_hash:{kind}"], policies, [0.05], seeds)


def told(kind):
    return (
        rf"scenario tests\.study\.test_world_hash:{kind} builds one world for history and another "
        r"for care of the seed 0: it draws outside its rng"
    )


@pytest.mark.parametrize("kind", ["Drawing", "Counting", "Shaping", "Reacting"])
def test_a_study_refuses_it_and_keeps_what_was_played(kind, tmp_path):
    with pytest.raises(InvalidInput, match=told(kind)):
        studied(plays(kind), tmp_path)
    assert not (tmp_path / "tables.md").exists()
    assert len((tmp_path / "journal.jsonl").read_text().splitlines()) == 4


def test_a_comparison_of_one_seed_refuses_it():
    with pytest.raises(InvalidInput, match=told("Drawing")):
        play_side_by_side(plays("Drawing", seeds=[0]))


def test_one_that_draws_from_its_seed_has_one_hash_per_seed():
    rows = [run_episode(config) for config in plays("Sound")]
    check_worlds(rows)
    assert len({(row["seed"], row["world_hash"]) for row in rows}) == 2
    assert len({row["world_hash"] for row in rows}) == 2


def test_folders_of_different_worlds_are_not_merged(tmp_path):
    for policy in ("history", "care"):
        studied(plays("Drawing", [policy], [0]), tmp_path / policy)
    with pytest.raises(InvalidInput, match=told("Drawing")):
        merged([tmp_path / "history", tmp_path / "care"])


def test_rows_of_built_in_scenarios_are_as_they_were():
    (config,) = grid(["dartout"], ["history"], [0.05], [0])
    assert "world_hash" not in run_episode(config)
