"""Make the map of the control `place`: the cells that detect first sightings on the calibration
streets.
"""

import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from care_sim.base.files import ZIP, check_output
from care_sim.core.defaults import AZIMUTH_MARGIN, ELEVATION_MARGIN
from care_sim.core.grid import AngularGrid, Cells
from care_sim.envs.open_loop import FilmEnv
from care_sim.loops.film import Film
from care_sim.policies.learned.weights import save_weights
from care_sim.policies.paper.blind import Full
from care_sim.sources.street_films import street_film
from care_sim.streets.street import CALIBRATION_SEEDS
from care_sim.training.supervised.fit import card_of, print_end, show_each
from care_sim.training.supervised.options import PlaceConfig


def train_place(config: PlaceConfig) -> int:
    """Make and write the map, and return the exit code of the command."""
    check_output(config.out, ZIP)
    started = time.perf_counter()
    seeds = show_each(CALIBRATION_SEEDS, "calibration street")
    found = [cells for seed in seeds for cells in first_returns(street_film(seed))]
    card = card_of(
        "place",
        "scipy",
        scenario="CARE-Street-v0",
        data=f"cells of {len(found)} first sightings that a full scan detects at once",
        seeds={"calibration": list(CALIBRATION_SEEDS)},
    )
    save_weights(config.out, {"sightings": sighting_map(found, AngularGrid())}, card)
    print_end(config.out, started, {"first sightings": len(found)}, None, "run", str(config.out))
    return 0


def first_returns(film: Film) -> Iterator[Cells]:
    """Return the cells of every first sighting of a film that a full scan detects at once."""
    with FilmEnv(film, budget=1.0) as env:
        observation, _ = env.reset(seed=0)
        full = Full(env.rig)
        while not env.loop.over:
            observation, *_ = env.step(full(observation))
        score = env.score
    for row in score.sightings.events[score.delays == 0]:
        cloud = film.shots[score.sightings.frames.keyframes[row]].cloud.to_shots()
        yield np.unique(cloud.cells[cloud.objects == score.sightings.frames.objects[row]])


def sighting_map(found: list[Cells], grid: AngularGrid) -> NDArray[np.float32]:
    """Return (E, A) first sightings per cell. Each sighting of `found` weighs 1, however many cells
    it has. Sightings are few, so they are smoothed over the paper's margins, its estimate of box
    errors. Columns wrap around.
    """
    sightings = np.zeros(grid.size)
    for cells in found:
        sightings[cells] += 1 / len(cells)
    return gaussian_filter(
        sightings.reshape(grid.shape),
        (ELEVATION_MARGIN, AZIMUTH_MARGIN),
        mode=("nearest", "wrap"),
    ).astype(np.float32)
