"""Vectors of drawn environments, conditions, policies and seeds are their single environments."""

import os
from dataclasses import fields
from random import Random

import pytest

from care_sim.certify.design import CLOSED, drawn
from care_sim.scenarios.dartout import Dense
from tests.envs.vector.test_same_episodes import CONDITIONS, OWN
from tests.helpers.vectors import MODES, played_alike

BATCHES = max(1, int(os.environ.get("CARE_SIM_DRAWN", "2000")) // 100)
FALSE_BOXES = ("camera_profile", "false_positive_rate")
OF_THE_SCENARIO = {field.name for field in fields(Dense)}


def first_difference(number):
    """Where worlds of the number differ first from single environments, None nowhere.

    The arguments are those of an episode of the certificate, with the conditions of a case of
    `test_same_episodes` over half of them.
    """
    rng = Random(f"vectors {number}")
    episodes = (drawn(rng.randrange(10_000)) for _ in range(100))
    episode = next(one for one in episodes if one.environment in CLOSED)
    arguments = dict(episode.arguments)
    conditions = rng.choice([*CONDITIONS.values(), *OWN.values()]) if rng.random() < 0.5 else {}
    # Parameters of the dense street's scenario are none of every other one's.
    arguments |= {name: v for name, v in conditions.items() if name not in OF_THE_SCENARIO}
    # False boxes are those of another whole world, which takes seconds, and with Bullet minutes:
    # one episode in four keeps its own.
    if "engine" in arguments or rng.random() < 0.75:
        for name in FALSE_BOXES:
            arguments.pop(name, None)
    if "camera_latency_s" in arguments:
        arguments.pop("camera_latency", None)
    if arguments.get("driver") == "careful-human":
        arguments = {name: v for name, v in arguments.items() if not name.startswith("brake_")}
    if arguments.get("detector"):
        arguments.pop("min_returns", None)
    return played_alike(
        episode.environment,
        worlds=3,
        steps=min(episode.keyframes, 8),
        mode=rng.choice(MODES),
        threads=rng.choice((1, 2)),
        policy=rng.choice(("care", "random", "history", "care-sector")),
        seed=episode.seed,
        **arguments,
    )


@pytest.mark.parametrize("number", range(12))
def test_drawn_worlds_are_single_ones(number):
    assert first_difference(number) is None


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(BATCHES))
def test_two_thousand_drawn_worlds_are_single_ones(batch):
    """As many as CARE_SIM_DRAWN says: `.ci/run` has 100."""
    numbers = range(100 + 100 * batch, 200 + 100 * batch)
    assert {number: found for number in numbers if (found := first_difference(number))} == {}
