"""What the stages of a keyframe read, write and compute, counted on episodes of the dense street:
`python -m care_sim.measure.traffic`. For the estimate of `docs/gpu.md`.

Bytes are those of the rows in use, each array once a stage: of `memory` those of state, actions and
observations, which outlive a stage, of `scratch` those that do not. Operations are units of work,
counted, times what one takes in the source of its kernel.
"""

import time
from collections.abc import Iterator
from typing import NamedTuple, cast

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.beliefs import Beliefs
from care_sim.core.grid import AngularGrid
from care_sim.core.pinhole import NEAR_M
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.sensing import sensing
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.policies.base import RowPolicy
from care_sim.scenarios.mirroring import Reflection
from care_sim.sensors.camera import window_on
from care_sim.sensors.engines.silhouette_kernels import lay_silhouettes, room_for
from care_sim.sensors.engines.view_kernels import Lens, Meshes, PlacedCamera
from care_sim.sensors.engines.window_kernels import Parts, SensorPose, place_parts
from care_sim.study.episode_config import EpisodeConfig
from care_sim.world.bullet import FAR_M
from care_sim.world.traffic import RoadVehicle
from care_sim.world.world import Actor, whole_steps

_NUMBER, _SINGLE = 8, 4
"""Bytes of the numbers of the state, and of those of actions and observations."""
_POSE, _BOX, _TRACK, _LANE = (columns * _NUMBER for columns in (7, 7, 13, 6))
_RAY_TEST = 45
"""A ray against a box: three scalar products, and three slabs of two quotients each."""
_PART = 250
"""A part put before the sensor: eight corners, their azimuths and elevations."""
_CORNER, _PLANE, _LINE, _CROSSING = 20, 30, 3, 4
"""A corner in the picture; a face as a plane over it; an outline's line; and a line at a row."""
_FACE_PIXEL, _PIXEL = 4, 3
"""A face's depth at a pixel, and the depth test there."""


class Load(NamedTuple):
    """Of one stage in one keyframe: bytes and operations; and `serial`, the steps of which each
    waits for the one before, where they are many.
    """

    memory: float
    scratch: float
    operations: float
    serial: float = 0.0


def loads(episodes: int, scenario: str = "dense") -> tuple[dict[str, Load], dict[str, float]]:
    """Means over all keyframes of the episodes of the seeds from 0 on, with `care` at 10%: the load
    of every stage, and the `counts` that it comes from.
    """
    told: list[tuple[dict[str, Load], dict[str, float]]] = []
    for seed in range(episodes):
        told += _keyframes(EpisodeConfig(scenario, "care", 0.1, seed))
    stages = {
        name: Load(*np.mean([load[name] for load, _ in told], axis=0).tolist())
        for name in told[0][0]
    }
    means = {name: float(np.mean([counts[name] for _, counts in told])) for name in told[0][1]}
    return stages, {"keyframes of an episode": len(told) / episodes, **means}


def reset_ms(episodes: int, scenario: str = "dense") -> float:
    """Milliseconds of a core that the beginning of an episode takes, the first one left out."""
    with EpisodeConfig(scenario, "care", 0.1, 0).make_env() as env:
        env.reset(seed=0)
        worked = time.process_time()
        for seed in range(1, episodes + 1):
            env.reset(seed=seed)
        worked = time.process_time() - worked
    return 1e3 * worked / episodes


def _keyframes(config: EpisodeConfig) -> Iterator[tuple[dict[str, Load], dict[str, float]]]:
    with config.make_env() as env:
        played = cast(ClosedLoopEnv, sensing(env))
        policy = config.make_policy(env)
        assert isinstance(policy, RowPolicy)
        observation, _ = env.reset(seed=config.seed)
        ended = False
        while not ended:
            loop = played.loop
            stages = policy.stages(Beliefs.of(loop.belief, loop.rig))
            listed = sum(len(stage.sets.cells) for stage in stages)
            action = policy(observation)
            asked = int(np.count_nonzero(action))
            grid = cast(AngularGrid, loop.rig.grid)
            place = loop.sensor
            pose = np.array([place.x, place.y, place.z, place.yaw, place.roll, place.pitch])
            poses = loop.world.bullet.primitives.poses.copy()
            observation, _, terminated, truncated, info = env.step(action)
            ended = terminated or truncated
            cells = np.asarray(info["fired"])
            counts = {
                "listed": float(listed),
                "asked": float(asked),
                "fired": float(len(cells)),
                **_of_scan(loop, grid, pose, poses, cells),
                **_of_picture(loop),
                "bodies": float(len(poses)),
                "vehicles": 1.0 + sum(map(_drives, loop.world.actors)),
                "tracks": float(len(loop.belief.tracks)),
                "detections": float(len(loop.belief.detections)),
            }
            tables = sum(observation[name].nbytes for name in ("detections", "tracks"))
            yield _loads(counts, grid.size, tables, whole_steps(loop.rig.keyframe_s)), counts


def _drives(actor: Actor) -> bool:
    """Whether an actor is a driver among drivers, on either side of the street."""
    moved_by = actor.moved_by
    source = moved_by.of if isinstance(moved_by, Reflection) else moved_by
    return isinstance(source, RoadVehicle)


def _of_scan(
    loop: ClosedLoop, grid: AngularGrid, sensor: Floats, poses: Floats, cells: np.ndarray
) -> dict[str, float]:
    """The parts that rays may meet, and how often a fired ray lies in the window of a part: of that
    many tests those of rays that have met something nearer are left out when they are cast.
    """
    parts = Parts(*loop.world.bullet.primitives.tables)
    placed = place_parts(SensorPose(*sensor), parts, poses, grid.spacing, float(grid.range_m))
    fired = np.zeros(grid.shape, np.int64)
    fired.flat[cells] = 1
    tests = 0
    for first, last, upper, lower in placed.windows.tolist():
        if upper <= lower:
            columns = np.unique(np.arange(first, last + 1) % grid.columns)
            tests += int(fired[upper : lower + 1, columns].sum())
    in_reach = int((placed.windows[:, 2] <= placed.windows[:, 3]).sum())
    return {"parts": float(len(parts.owners)), "in reach": float(in_reach), "tests": float(tests)}


def _of_picture(loop: ClosedLoop) -> dict[str, float]:
    """The polyhedra in the picture of the first camera, their pixels row by row, and these times
    the faces that are turned to the camera.
    """
    camera = loop.rig.cameras[0]
    bullet = loop.world.bullet
    labelled = np.array([*loop.world.labels()])
    boxes = loop.sensor.boxes_to_local(loop.world.boxes_of(labelled))
    window = window_on(camera, boxes)
    _, top, right, bottom = window
    meshes = Meshes(*bullet.polyhedra.tables)
    room = room_for((len(meshes.owners), len(meshes.faces), len(meshes.edges)), right, bottom - top)
    lens = Lens(camera.focal, camera.width / 2, camera.height / 2)
    placed = PlacedCamera(*camera.stance(loop.sensor))
    room.starts[:] = 0
    lay_silhouettes(placed, lens, window, (NEAR_M, FAR_M), meshes, bullet.primitives.poses, room)
    pixels = faces = 0
    seen = set[int]()
    for row in range(bottom - top):
        for n in range(room.counts[row]):
            part = int(room.crossed[row, n])
            wide = int(room.stretches[row, n, 1] - room.stretches[row, n, 0])
            seen.add(part)
            pixels += wide
            faces += wide * int(room.starts[part + 1] - room.starts[part])
    return {
        "corners": float(len(meshes.corners)),
        "faces": float(len(meshes.faces)),
        "edges": float(len(meshes.edges)),
        "polyhedra": float(len(meshes.owners)),
        "in the picture": float(len(seen)),
        "rows": float(bottom - top),
        "stretches": float(room.counts[: bottom - top].sum()),
        "pixels": float(pixels),
        "faces at pixels": float(faces),
    }


def _loads(counts: dict[str, float], cells: int, tables: int, steps: int) -> dict[str, Load]:
    """The load of every stage; `cells` of the grid, bytes of the `tables` of an observation, and
    world `steps` of a keyframe.
    """
    fired, tests, bodies = counts["fired"], counts["tests"], counts["bodies"]
    parts, tracks, vehicles = counts["parts"], counts["tracks"], counts["vehicles"]
    corners, faces, edges = counts["corners"], counts["faces"], counts["edges"]
    has_floor = counts["asked"] < fired
    part_bytes = _NUMBER * (1 + 3 + 3 + 1)
    mesh_bytes = _NUMBER * (3 * corners + 4 * faces + 2 * edges)
    return {
        # Cells of sets are listed and read, chosen cells scored; last keyframe's are unscored.
        "policy and allocation": Load(
            tables + 2 * _SINGLE * counts["asked"],
            2 * _NUMBER * counts["listed"] + cells,
            2 * counts["listed"],
            counts["listed"],
        ),
        "choice of cells": Load(_SINGLE * cells + _NUMBER * fired, 3 * cells, 3 * cells),
        "floor": Load(
            0.0,
            2 * _SINGLE * cells * has_floor,
            # A word of the generator takes some 20 operations, and a quarter of them is refused.
            (20 * 4 / 3 + 3) * cells * has_floor,
            cells * has_floor,
        ),
        "rays": Load(
            part_bytes * parts + _POSE * bodies + 3 * _NUMBER * fired,
            _NUMBER * (17 * counts["in reach"] + 2 * 5 * tests),
            _PART * counts["in reach"] + _RAY_TEST * tests,
        ),
        "range image": Load(_SINGLE * cells + 3 * _NUMBER * fired, 0.0, fired),
        "proxy and tracks": Load(
            _NUMBER * fired + 6 * _TRACK * tracks + _BOX * bodies,
            0.0,
            fired + 100 * tracks + 10 * tracks * tracks,
        ),
        # Boxes are copied, and read and written again with the poses.
        "motion": Load(
            steps * (4 * _BOX * bodies + 2 * _POSE * bodies + 2 * _LANE * vehicles),
            0.0,
            steps * (20 * vehicles * vehicles + 10 * bodies),
        ),
        "picture": Load(
            mesh_bytes + _POSE * bodies,
            _NUMBER * (3 * counts["stretches"] * 2 + 3 * 2 * counts["pixels"]),
            _CORNER * corners
            + _PLANE * faces
            + _LINE * edges
            + _CROSSING * 8 * counts["stretches"]
            + _FACE_PIXEL * counts["faces at pixels"]
            + _PIXEL * counts["pixels"],
        ),
        "tables of the observation": Load(
            tables + _TRACK * tracks + 9 * _NUMBER * counts["detections"], 0.0, tables / _SINGLE
        ),
    }


def main() -> None:
    """Print the loads, the counts, and what a reset takes."""
    stages, counts = loads(20)
    print(
        f"{'stage':28}{'memory kB':>11}{'scratch kB':>12}{'thousand operations':>21}{'serial':>9}"
    )
    for name, load in (*stages.items(), ("all", Load(*np.sum([*stages.values()], axis=0)))):
        numbers = load.memory / 1e3, load.scratch / 1e3, load.operations / 1e3, load.serial
        print("{:28}{:11.1f}{:12.1f}{:21.1f}{:9.0f}".format(name, *numbers))
    print(", ".join(f"{name} {count:.4g}" for name, count in counts.items()))
    print(f"a reset: {reset_ms(40):.2f} ms of a core")


if __name__ == "__main__":
    main()
