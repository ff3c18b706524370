"""Examples for the learned detector: scans of generated streets and drives, or of the scenes of a
source, and the objects in them.

Truth is used here, at training, and nowhere else.

- A play is one street or one drive under one seed. Policies and budgets are drawn; an example is a
  keyframe. The detector's input is in the observation: the ranges of the fired cells.
- A quarter of the plays fire every cell. The budgets of the others are drawn evenly by their
  logarithm: a scan of a hundredth differs from one of a tenth as that does from the whole.
- Noise of ranges and lost returns are drawn for every play. Streets have the default set-up, since
  a film casts every cell of every keyframe; half of the drives have another one.
- Policies track by the paper's proxy. So their aim does not depend on a detector that is still to
  be trained.
- Plays of a source are its scenes. An example is then the input of `pillars`: recorded points up to
  the reach of the grid, or, without recorded sweeps, rays cast at the boxes.
- An object counts from one return on, since an object without returns is invisible.

Targets and loss follow CenterPoint (Yin, Zhou, Kraehenbuehl 2021, Sec. 4): a focal loss that
tolerates outputs near a centre, and absolute differences of box values.
"""

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.belief import Belief
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import FilmedReturns
from care_sim.core.types import CLASSES
from care_sim.envs.open_loop import FilmEnv
from care_sim.envs.scenarios import DriveEnv
from care_sim.loops.film import Film
from care_sim.perception.pillars.decoding import points_within
from care_sim.perception.pillars.network import BOX_OUTPUTS, CELL_M, CELLS, REACH_M
from care_sim.policies import make_policy
from care_sim.sensors.annotated import Annotations
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_setup
from care_sim.sources.street_films import record
from care_sim.streets.street import make_street
from care_sim.training.supervised.worlds import AnyEnv, World

POLICIES = (
    "random", "history", "history-uniform", "uncertainty", "beam-reduce", "all-camera", "care",
    "care-priority", "care-sbf", "care-spread", "care-sightlines", "care-sector", "care-units",
    "rows", "fan", "stride", "sweep", "history-rows",
)  # fmt: skip
"""Shipped policies that fit any grid."""
EITHER, CLUTTERED = "street or drive", "cluttered street"
"""Kinds of generated worlds."""
LEAST_BUDGET, MOST_BUDGET = 0.01, 0.6
FULL_SHARE, FULL_SHARE_CLUTTERED = 0.25, 0.5
"""Share of plays in which every cell fires. Larger on cluttered streets, which also serve recorded
sweeps, which are full.
"""
RANGE_SIGMAS_M = (0.0, 0.02, 0.05)
DROPOUTS = (0.0, 0.05, 0.2)
OTHER_SETUPS = ("m1-forward", "os1-64", "paper-vehicle", "roof-and-corners")
RECORDED_SETUPS = ("nuscenes", "argoverse-2")
"""Each of these set-ups sees a quarter of the cluttered streets, as densely as recorded sweeps. The
default set-up sees a quarter, others a quarter.
"""
PLAYS_OF_FILM = 3
"""Plays for which a film is made once."""
SHARE_KEPT = 1 / 3
"""Share of a play's keyframes that become examples: neighbours resemble each other."""
RARE = (CLASSES.index("bus"), CLASSES.index("bicycle"))
"""Rare classes, under 1% and 3% of the streets' objects: a keyframe with a return of one always
becomes an example.
"""
MOST_TURN = 0.4
"""Largest rotation of a scan in training, either way, radians; every second scan is also mirrored.
Generated streets are mostly straight.
"""
DRIVE_KEYFRAME_S = 0.5
"""Seconds between keyframes, as on a street."""
_ROUND_BOX_M = 0.2
"""Margin of a box on either side for its returns: noise of ranges."""
_NO_RETURN_M = 1e-3
"""A range this near to the reach is no return."""


@dataclass(frozen=True)
class Example:
    """A scan and its objects: `points` (P, 3) in the sensor frame, `classes` (n,) and `boxes` (n,
    7) of all objects on the plan with a return. `full` is True if every cell fired.
    """

    points: NDArray[np.float32]
    sensor_height_m: float
    classes: Integers
    boxes: Floats
    full: bool = False


def play(world: World) -> list[Example]:
    """Yield the examples of a world: a `CLUTTERED` street, `EITHER` a street or a drive as the seed
    draws, or a source's scene.
    """
    rng = np.random.default_rng([world.seed, 21])
    if world.film:
        return [*_film(world.film(), world.seed, rng, _detector_input)]
    if world.kind == CLUTTERED:
        return [*_street(world.seed, rng, clutter=True)]
    # Drawn, since the layouts of streets come in turn.
    return [*(_street if rng.random() < 0.5 else _drive)(world.seed, rng)]


def _street(seed: int, rng: np.random.Generator, clutter: bool = False) -> Iterator[Example]:
    setup = sensor_setup(_sensor_among_clutter(rng) if clutter else DEFAULT_SETUP)
    film = record(make_street(seed, clutter), setup, FilmedReturns(clutter=clutter))
    return _film(film, seed, rng, _by_ranges, clutter)


def _film(
    film: Film, seed: int, rng: np.random.Generator, look: "_Look", clutter: bool = False
) -> Iterator[Example]:
    # No observation follows the last keyframe, so its ranges are missing.
    keyframes = len(film.shots) - 1
    for _ in range(PLAYS_OF_FILM):
        with closing(FilmEnv(film, clutter=clutter, **_conditions(rng, clutter))) as env:
            yield from _examples(env, seed, rng, keyframes, look)


def _drive(seed: int, rng: np.random.Generator) -> Iterator[Example]:
    told: dict[str, Any] = {"sensor": _sensor(rng), "keyframe_s": DRIVE_KEYFRAME_S}
    with closing(DriveEnv(**told, **_conditions(rng))) as env:
        keyframes = round(env.scenario.duration_s / DRIVE_KEYFRAME_S)
        yield from _examples(env, seed, rng, keyframes, _by_ranges)


def _sensor(rng: np.random.Generator) -> str:
    other = rng.random() < 0.5
    return str(rng.choice(OTHER_SETUPS)) if other else DEFAULT_SETUP


def _sensor_among_clutter(rng: np.random.Generator) -> str:
    return str(rng.choice([DEFAULT_SETUP, str(rng.choice(OTHER_SETUPS)), *RECORDED_SETUPS]))


def _conditions(rng: np.random.Generator, clutter: bool = False) -> dict[str, Any]:
    full = rng.random() < (FULL_SHARE_CLUTTERED if clutter else FULL_SHARE)
    low, high = np.log([LEAST_BUDGET, MOST_BUDGET])
    drawn = float(np.exp(rng.uniform(low, high)))
    return {
        "budget": 1.0 if full else drawn,
        "lidar_range_sigma": float(rng.choice(RANGE_SIGMAS_M)),
        "lidar_dropout": float(rng.choice(DROPOUTS)),
    }


def _examples(
    env: AnyEnv, seed: int, rng: np.random.Generator, keyframes: int, look: "_Look"
) -> Iterator[Example]:
    full = env.rig.budget == env.rig.grid.size
    policy = make_policy("full" if full else str(rng.choice(POLICIES)), env)
    observation, _ = env.reset(seed=seed)
    policy.reset()
    for _ in range(keyframes):
        # The truth of the scan is that before the step, which advances the world.
        present = _present(env)
        observation, _, terminated, truncated, _ = env.step(policy(observation))
        example = look(env, observation, present, full)
        if rng.random() < SHARE_KEPT or np.isin(RARE, example.classes).any():
            yield example
        if terminated or truncated:
            break


_Look = Callable[[Any, Any, Annotations, bool], Example]
"""Makes an example after a step, from the environment, its observation, the present objects, and
whether every cell fired.
"""


def _by_ranges(env: AnyEnv, observation: Any, present: Annotations, full: bool) -> Example:
    points = scanned(env.rig.grid, Belief.from_observation(observation).ranges)
    return _example(points, env.rig.sensor_height_m, present, full)


def _detector_input(env: FilmEnv, _: Any, present: Annotations, full: bool) -> Example:
    """Return the detector's input: measured points of all gathered sweeps. The source gives the
    object of each point, since a real road is not level.
    """
    cloud = env.loop.handed
    seen = np.isin(present.objects, cloud.objects) & within_plan(present.boxes)
    points = cloud.points.astype(np.float32)
    height_m = env.rig.sensor_height_m
    return Example(points, height_m, present.classes[seen], present.boxes[seen], full)


def _present(env: AnyEnv) -> Annotations:
    """Return all objects that perception reports, at the next keyframe."""
    if isinstance(env, FilmEnv):
        return env.loop.shot.annotations
    world, sensor = env.loop.world, env.loop.sensor
    labels = world.labels()
    bodies = np.array([*labels], np.int64)
    boxes = sensor.boxes_to_local(world.boxes_of(bodies))
    return Annotations(bodies, np.array([*labels.values()], np.int64), boxes)


def scanned(grid: Grid, ranges: NDArray[np.float32]) -> Floats:
    """Return (P, 3) the points of a range image (E, A), which holds 0 for unfired cells and the
    reach for no return.
    """
    told = ranges.ravel().astype(np.float64)
    cells = np.flatnonzero(told)
    reach = np.broadcast_to(grid.reach_of(cells), cells.shape)
    cells = cells[told[cells] < np.minimum(reach, grid.range_m) - _NO_RETURN_M]
    return grid.points(cells, told[cells])


def _example(points: Floats, sensor_height_m: float, present: Annotations, full: bool) -> Example:
    boxes = present.boxes
    # Also lifted: the road beneath a body, or a pavement, is no return of it.
    round_it = _ROUND_BOX_M * np.array([0.0, 0.0, 1.0, 2.0, 2.0, 0.0, 0.0])
    returns = points_within(np.ascontiguousarray(points), boxes + round_it)
    seen = (returns > 0) & within_plan(boxes)
    return Example(
        points.astype(np.float32), sensor_height_m, present.classes[seen], boxes[seen], full
    )


def within_plan(boxes: Floats) -> Mask:
    """Return (n,) which of boxes (n, 7) have their middle on the plan."""
    return np.asarray(np.abs(boxes[:, :2]).max(axis=1, initial=0) < REACH_M)


def turned_example(example: Example, rng: np.random.Generator) -> Example:
    """Return the example rotated and possibly mirrored. Objects that leave the plan at its corners
    are left out.
    """
    side = float(rng.choice([-1.0, 1.0]))
    turn = float(rng.uniform(-MOST_TURN, MOST_TURN))
    cos, sin = np.cos(turn), np.sin(turn)
    matrix = np.array([[cos, -sin * side], [sin, cos * side]])
    points, boxes = example.points.copy(), example.boxes.copy()
    points[:, :2] = points[:, :2] @ matrix.T.astype(np.float32)
    boxes[:, :2] = boxes[:, :2] @ matrix.T
    boxes[:, 6] = side * boxes[:, 6] + turn
    kept = within_plan(boxes)
    return Example(
        points, example.sensor_height_m, example.classes[kept], boxes[kept], example.full
    )


SPREAD_M = (0.8, 1.6)
"""Standard deviation of the bump at a centre, of a person and of the longest bus; between them a
quarter of the length.
"""
TOLD_FROM = 0.2
"""Height of a bump from which a cell predicts the box: neighbours of the centre predict it too."""
BOX_SHARE = 1.0
"""Weight of box differences in the loss."""


class Targets(NamedTuple):
    """Targets of s scans. `sure` (s, classes, CELLS, CELLS) are bumps of height 1 at the centres,
    `boxes` (s, BOX_OUTPUTS, CELLS, CELLS) the outputs. `weights` (s, 1, CELLS, CELLS) belong to
    each cell's box.
    """

    sure: NDArray[np.float32]
    boxes: NDArray[np.float32]
    weights: NDArray[np.float32]


def targets_of(examples: list[Example]) -> Targets:
    """Return the targets of the network."""
    s = len(examples)
    made = Targets(
        np.zeros((s, len(CLASSES), CELLS, CELLS), np.float32),
        np.zeros((s, len(BOX_OUTPUTS), CELLS, CELLS), np.float32),
        np.zeros((s, 1, CELLS, CELLS), np.float32),
    )
    for number, example in enumerate(examples):
        for label, box in zip(example.classes.tolist(), example.boxes, strict=True):
            own = Targets(*(table[number] for table in made))
            _mark(own, label, box, example.sensor_height_m)
    return made


def loss(torch: Any, answer: Any, wanted: Any) -> Any:
    """Return the loss of an output (s, OUTPUTS, CELLS, CELLS) against `Targets` as tensors."""
    sure, told = answer[:, : len(CLASSES)], answer[:, len(CLASSES) :]
    log = torch.nn.functional.logsigmoid
    chance = torch.sigmoid(sure)
    centre = wanted.sure == 1
    missed = (1 - chance) ** 2 * log(sure) * centre
    invented = (1 - wanted.sure) ** 4 * chance**2 * log(-sure)
    centres = centre.sum().clamp(min=1)

    off = ((told - wanted.boxes).abs() * wanted.weights).sum() / wanted.weights.sum().clamp(min=1)
    return -(missed + invented).sum() / centres + BOX_SHARE * off


def box_targets(
    box: Floats, sensor_height_m: float, rows: Integers, columns: Integers
) -> NDArray[np.float32]:
    """Return (BOX_OUTPUTS, n) the targets of cells at `rows` (n,) and `columns` (n,) for a box
    (7,).
    """
    x, y, z, length, width, height, yaw = box.tolist()
    away_x = x - ((rows + 0.5) * CELL_M - REACH_M)
    away_y = y - ((columns + 0.5) * CELL_M - REACH_M)
    alike = [
        z + sensor_height_m, *np.log([length, width, height]),
        np.cos(yaw), np.sin(yaw), np.cos(2 * yaw), np.sin(2 * yaw),
    ]  # fmt: skip
    rest = np.repeat(np.array(alike)[:, None], len(rows), axis=1)
    return np.concatenate([away_x[None], away_y[None], rest]).astype(np.float32)


def _mark(own: Targets, label: int, box: Floats, sensor_height_m: float) -> None:
    """Enter an object into the targets of its scan."""
    spread = float(np.clip(box[3] / 4, *SPREAD_M)) / CELL_M
    centre = np.minimum(((box[:2] + REACH_M) / CELL_M).astype(np.int64), CELLS - 1)
    reach = int(np.ceil(3 * spread))
    low, high = np.maximum(centre - reach, 0), np.minimum(centre + reach + 1, CELLS)
    rows, columns = np.mgrid[low[0] : high[0], low[1] : high[1]].reshape(2, -1)
    away = (rows - centre[0]) ** 2 + (columns - centre[1]) ** 2
    bump = np.exp(-away / (2 * spread**2)).astype(np.float32)
    own.sure[label, rows, columns] = np.maximum(own.sure[label, rows, columns], bump)

    # A cell between two objects predicts the object with the higher bump.
    near = (bump > TOLD_FROM) & (bump > own.weights[0, rows, columns])
    rows, columns = rows[near], columns[near]
    own.weights[0, rows, columns] = bump[near]
    own.boxes[:, rows, columns] = box_targets(box, sensor_height_m, rows, columns)
