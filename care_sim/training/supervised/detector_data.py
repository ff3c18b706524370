"""Examples for the learned detector: scans of generated streets and drives, or of the scenes of a
source, and the objects in them.

Truth is used here, at training, and nowhere else.

- A play is one street or one drive under one seed. Policies play it at budgets, all drawn; an
  example is a keyframe of it. What a detector would be handed is what the observation holds: the
  ranges of the cells that fired.
- A quarter of the plays fire every cell. The budgets of the others are drawn evenly by their
  logarithm: a scan of a hundredth differs from one of a tenth as that does from the whole.
- Noise of ranges and lost returns are drawn for every play. Streets have the default set-up, since
  a film casts every cell of every keyframe; of drives half have another one.
- Policies track what they find by the paper's proxy. So what they aim at does not hang on a
  detector that is still to be trained.
- Of a source every play is one of its scenes. An example is then the points that `pillars` would
  be handed: recorded ones where they were measured, up to the reach of the grid; without recorded
  sweeps those of rays cast at the boxes.
- An object counts from one return on. What has none cannot be told from nothing.

What the network should answer, and by how much its answer is off, follows CenterPoint (Yin, Zhou,
Kraehenbuehl 2021, Sec. 4): a focal loss that forgives answers near a centre, and absolute
differences of what is told of the box.
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
"""Those that come with the package and know any grid."""
EITHER, CLUTTERED = "street or drive", "cluttered street"
"""Kinds of generated worlds."""
LEAST_BUDGET, MOST_BUDGET = 0.01, 0.6
FULL_SHARE, FULL_SHARE_CLUTTERED = 0.25, 0.5
"""Of plays in which every cell fires. Those of cluttered streets are for recorded sweeps, too,
which are full.
"""
RANGE_SIGMAS_M = (0.0, 0.02, 0.05)
DROPOUTS = (0.0, 0.05, 0.2)
OTHER_SETUPS = ("m1-forward", "os1-64", "paper-vehicle", "roof-and-corners")
RECORDED_SETUPS = ("nuscenes", "argoverse-2")
"""Of cluttered streets a quarter is seen by each of these, as densely as recorded sweeps are; a
quarter by the default set-up and a quarter by others."""
PLAYS_OF_FILM = 3
"""Plays for which a film is made once."""
SHARE_KEPT = 1 / 3
"""Of the keyframes of a play, drawn, that become examples: neighbours resemble each other."""
RARE = (CLASSES.index("bus"), CLASSES.index("bicycle"))
"""Of the objects of the streets under 1 and 3 in a hundred: a keyframe with a return of one
always becomes an example."""
MOST_TURN = 0.4
"""Radians by which a scan is turned for the learning, either way; every second one is mirrored,
too. Generated streets are mostly straight."""
DRIVE_KEYFRAME_S = 0.5
"""As far apart as those of a street."""
_ROUND_BOX_M = 0.2
"""A box is taken so much larger on either side for its returns: noise of ranges."""
_NO_RETURN_M = 1e-3
"""A range this near to the reach is none."""


@dataclass(frozen=True)
class Example:
    """A scan and what stands in it: `points` (P, 3) in the sensor frame, `classes` (n,), `boxes`
    (n, 7); all objects within the plan that have a return. `full` says that every cell fired.
    """

    points: NDArray[np.float32]
    sensor_height_m: float
    classes: Integers
    boxes: Floats
    full: bool = False


def play(world: World) -> list[Example]:
    """The examples of a world: of a `CLUTTERED` street, of `EITHER` a street or a drive, as the
    seed draws it, or of the scene of a source.
    """
    rng = np.random.default_rng([world.seed, 21])
    if world.film:
        return [*_film(world.film(), world.seed, rng, _handed)]
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
    # After the last keyframe nobody looks, so its ranges are in no observation.
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
        # The truth of the scan is that of the time before the step, which moves the world on.
        present = _present(env)
        observation, _, terminated, truncated, _ = env.step(policy(observation))
        example = look(env, observation, present, full)
        if rng.random() < SHARE_KEPT or np.isin(RARE, example.classes).any():
            yield example
        if terminated or truncated:
            break


_Look = Callable[[Any, Any, Annotations, bool], Example]
"""Makes an example of an environment after a step: of its observation, what was present, and
whether every cell fired."""


def _by_ranges(env: AnyEnv, observation: Any, present: Annotations, full: bool) -> Example:
    points = scanned(env.rig.grid, Belief.from_observation(observation).ranges)
    return _example(points, env.rig.sensor_height_m, present, full)


def _handed(env: FilmEnv, _: Any, present: Annotations, full: bool) -> Example:
    """Return what the detector received: points where they were measured, of all sweeps that the
    source gathers. The source says on whom they lie: a real road is not level.
    """
    cloud = env.loop.handed
    seen = np.isin(present.objects, cloud.objects) & within_plan(present.boxes)
    points = cloud.points.astype(np.float32)
    height_m = env.rig.sensor_height_m
    return Example(points, height_m, present.classes[seen], present.boxes[seen], full)


def _present(env: AnyEnv) -> Annotations:
    """Everything that perception reports, at the coming keyframe."""
    if isinstance(env, FilmEnv):
        return env.loop.shot.annotations
    world, sensor = env.loop.world, env.loop.sensor
    labels = world.labels()
    bodies = np.array([*labels], np.int64)
    boxes = sensor.boxes_to_local(world.boxes_of(bodies))
    return Annotations(bodies, np.array([*labels.values()], np.int64), boxes)


def scanned(grid: Grid, ranges: NDArray[np.float32]) -> Floats:
    """(P, 3) the points of a range image (E, A): 0 where nothing fired, the reach where nothing
    returned.
    """
    told = ranges.ravel().astype(np.float64)
    cells = np.flatnonzero(told)
    reach = np.broadcast_to(grid.reach_of(cells), cells.shape)
    cells = cells[told[cells] < np.minimum(reach, grid.range_m) - _NO_RETURN_M]
    return grid.points(cells, told[cells])


def _example(points: Floats, sensor_height_m: float, present: Annotations, full: bool) -> Example:
    boxes = present.boxes
    # Lifted, too: the road beneath a body, or a pavement, is no return of it.
    round_it = _ROUND_BOX_M * np.array([0.0, 0.0, 1.0, 2.0, 2.0, 0.0, 0.0])
    returns = points_within(np.ascontiguousarray(points), boxes + round_it)
    seen = (returns > 0) & within_plan(boxes)
    return Example(
        points.astype(np.float32), sensor_height_m, present.classes[seen], boxes[seen], full
    )


def within_plan(boxes: Floats) -> Mask:
    """(n,) which of boxes (n, 7) have their middle on the plan."""
    return np.asarray(np.abs(boxes[:, :2]).max(axis=1, initial=0) < REACH_M)


def turned_example(example: Example, rng: np.random.Generator) -> Example:
    """The example as another way of the sensor would have it: mirrored or not, and turned. What
    stood in a corner of the plan may stand beside it then, and is left out.
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
"""Standard deviation of the bump at a centre: of a person, and of the longest bus; between them a
quarter of the length."""
TOLD_FROM = 0.2
"""Where a bump is higher, the cell is asked for the box: neighbours of the centre tell of it, too.
"""
BOX_SHARE = 1.0
"""Of the differences of boxes in the loss."""


class Targets(NamedTuple):
    """Targets of s scans: `sure` (s, classes, CELLS, CELLS) bumps of height 1 at the centres,
    `boxes` (s, BOX_OUTPUTS, CELLS, CELLS), and how much each cell's box counts, `weights` (s, 1,
    CELLS, CELLS).
    """

    sure: NDArray[np.float32]
    boxes: NDArray[np.float32]
    weights: NDArray[np.float32]


def targets_of(examples: list[Example]) -> Targets:
    """Return the answers that the network should give."""
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
    """How much an answer (s, OUTPUTS, CELLS, CELLS) is off the `Targets` as tensors."""
    sure, told = answer[:, : len(CLASSES)], answer[:, len(CLASSES) :]
    log = torch.nn.functional.logsigmoid
    chance = torch.sigmoid(sure)
    centre = wanted.sure == 1
    missed = (1 - chance) ** 2 * log(sure) * centre
    invented = (1 - wanted.sure) ** 4 * chance**2 * log(-sure)
    centres = centre.sum().clamp(min=1)

    off = ((told - wanted.boxes).abs() * wanted.weights).sum() / wanted.weights.sum().clamp(min=1)
    return -(missed + invented).sum() / centres + BOX_SHARE * off


def box_told(
    box: Floats, sensor_height_m: float, rows: Integers, columns: Integers
) -> NDArray[np.float32]:
    """(BOX_OUTPUTS, n) what cells in these `rows` (n,) and `columns` (n,) should tell of a box
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

    # A cell between two objects tells of the one whose bump is higher there.
    near = (bump > TOLD_FROM) & (bump > own.weights[0, rows, columns])
    rows, columns = rows[near], columns[near]
    own.weights[0, rows, columns] = bump[near]
    own.boxes[:, rows, columns] = box_told(box, sensor_height_m, rows, columns)
