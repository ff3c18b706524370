"""Rows of validations, made by hand."""

from care_sim.base.seeds import training_seeds
from care_sim.study.episode_config import grid
from tests.helpers.made_rows import row

SEEDS = 6


def cell(policy, distances, hits=0, *, training=False, budget=0.03, parameters=()):
    """One row a distance; the last `hits` of them hit somebody."""
    seeds = training_seeds(len(distances)) if training else range(len(distances))
    configs = grid(["dartout"], [policy], [budget], seeds, scenario_parameters=parameters)
    first_hit = len(distances) - hits
    return [
        row(config, distance, collision=n >= first_hit, tags=tags(policy))
        for n, (config, distance) in enumerate(zip(configs, distances, strict=True))
    ]


def tags(policy):
    if policy == "seed-finder":
        return "generator+control"
    return "causal+control" if policy in ("fan", "rows") else "causal"


def world(test, training, **where):
    """Rows of a world: by policy the detection distance and the number of hits, the same on all
    seeds, for test and training seeds.
    """
    return [
        each
        for part, in_training in ((training, True), (test, False))
        for policy, (distance, hits) in part.items()
        for each in cell(policy, [distance] * SEEDS, hits, training=in_training, **where)
    ]


TRAINING = {
    "all-camera": (12.0, 2),
    "care": (15.0, 0),
    "fan": (14.0, 1),
    "rows": (9.0, 0),
    "seed-finder": (16.0, 0),
}
"""CARE is the best with a camera; `rows` hits nobody, so that the earlier `fan` is worse."""
SATURATED = {
    "full": (16.0, 0),
    "seed-finder": (16.0, 0),
    "history": (8.0, 0),
    "random": (7.0, 0),
    "all-camera": (16.0, 0),
    "care": (16.0, 0),
    "fan": (16.0, 0),
    "rows": (16.0, 0),
}
TELLING = {
    "full": (16.0, 1),
    "seed-finder": (15.5, 1),
    "history": (5.0, 6),
    "random": (4.0, 6),
    "all-camera": (11.0, 3),
    "care": (15.0, 1),
    "fan": (15.0, 1),
    "rows": (10.0, 4),
}
MIRRORED = (("mirrored", "drawn"),)
STUDY = [
    *world(SATURATED, TRAINING),
    *world(TELLING, TRAINING, parameters=MIRRORED),
]
