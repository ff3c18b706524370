"""Episodes of the list played by worker processes, and which can be played here."""

from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, as_completed
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium
import pyarrow as pa
from pyarrow import feather

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_open3d
from care_sim.certify.design import AS_LISTED, REPLAY, STREET, Drawn, drawn
from care_sim.certify.trail import Trail
from care_sim.policies import make_policy
from care_sim.policies.base import Policy
from care_sim.study.episode_play import result_or_reason
from care_sim.study.executors import ExecutorFactory, Processes, processes

_LOG = "certified-drive"
_SWEEPS = 50
_SWEEP_S = 0.1
_START_NS = 315_000_000_000_000_000
_AHEAD = {"qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0}
_ACROSS = {"qw": 0.8, "qx": 0.0, "qy": 0.0, "qz": -0.6}
"""A turn to the right by 74 degrees: cos and sin of half of it are 0.8 and 0.6 exactly."""


def write_drive(folder: Path) -> str:
    """Write the log below `folder`; returns the source of recordings that names it.

    The car drives 5 m/s past a van, parked cars and an oncoming bus; halfway a person steps out
    from behind the van, and a bicycle comes after.
    """
    log = folder / _LOG
    log.mkdir(parents=True)
    boxes = [box for sweep in range(_SWEEPS) for box in _boxes(sweep)]
    poses = [
        {"timestamp_ns": _stamp(n), "tx_m": 1000.0 + 0.5 * n, "ty_m": -500.0, "tz_m": 60.0} | _AHEAD
        for n in range(_SWEEPS)
    ]
    feather.write_feather(pa.Table.from_pylist(boxes), log / "annotations.feather")
    feather.write_feather(pa.Table.from_pylist(poses), log / "city_SE3_egovehicle.feather")
    return f"argoverse2:{folder}"


def _boxes(sweep: int) -> list[dict[str, Any]]:
    """The bodies at a sweep, in the frame of the car."""
    # The car drives 0.5 m per sweep, so that what stands still comes nearer by as much.
    ahead = 30.0 - 0.5 * sweep
    bus_ahead = ahead + 25.0 - 0.6 * sweep
    person_y, bicycle_y = -4.0 + 0.13 * (sweep - 20), 6.0 - 0.3 * (sweep - 30)
    bodies: list[tuple[str, str, tuple[float, ...], tuple[float, ...], dict[str, float]]] = [
        ("BOX_TRUCK", "van", (ahead, -4.0, 0.9), (6.0, 2.2, 2.6), _AHEAD),
        ("REGULAR_VEHICLE", "parked", (ahead + 9.0, -4.2, 0.42), (4.4, 1.9, 1.5), _AHEAD),
        ("REGULAR_VEHICLE", "parked behind", (ahead + 15.5, -4.1, 0.42), (4.2, 1.8, 1.5), _AHEAD),
        ("BUS", "oncoming", (bus_ahead, 3.7, 1.2), (11.0, 2.6, 3.2), _AHEAD),
        ("PEDESTRIAN", "person", (ahead + 5.0, person_y, 0.6), (0.6, 0.7, 1.8), _ACROSS),
        ("BICYCLE", "bicycle", (ahead + 12.0, bicycle_y, 0.4), (1.8, 0.6, 1.4), _ACROSS),
    ]
    begins = {"person": 20, "bicycle": 30}
    return [
        {
            "timestamp_ns": _stamp(sweep),
            "track_uuid": track,
            "category": category,
            "num_interior_pts": 10,
            **dict(zip(("tx_m", "ty_m", "tz_m"), place, strict=True)),
            **dict(zip(("length_m", "width_m", "height_m"), size, strict=True)),
            **turn,
        }
        for category, track, place, size, turn in bodies
        if sweep >= begins.get(track, 0)
    ]


def _stamp(sweep: int) -> int:
    return _START_NS + round(sweep * _SWEEP_S * 1e9)


Trails = dict[int, bytes | str]
"""The trail of every episode by number, or in one line why there is none."""

FARTHEST = "farthest-points"
"""The policy that needs Open3D."""

_BATCH = 24


def playable_here(episodes: Sequence[Drawn]) -> tuple[list[Drawn], str]:
    """The episodes that can be played with what is installed, and a line where that is not all."""
    able = [episode for episode in episodes if episode.policy != FARTHEST]
    lacking = len(episodes) - len(able)
    try:
        if lacking:
            import_open3d()
    except MissingExtra as error:
        return able, f"{lacking:,} of {len(episodes):,} not played: {error}"
    return [*episodes], ""


def trails_of(
    numbers: Sequence[int],
    workers: int,
    show: Callable[[int], None] = lambda _done: None,
    make_executor: ExecutorFactory = processes,
) -> Trails:
    """Play episodes; `show` is called with the number of those done. An interrupt waits for none of
    them.
    """
    found: Trails = {}
    with TemporaryDirectory(prefix="care-sim-certify-") as folder:
        source = write_drive(Path(folder))
        waiting = episode_batches([drawn(number) for number in numbers])
        executor = make_executor(min(workers, max(len(waiting), 1)))
        try:
            futures = {executor.submit(attempt, batch, source): batch for batch in waiting}
            for future in as_completed(futures):
                # A worker that died takes its batch with it, and the others with theirs: the reason
                # stands in the place of the trails.
                try:
                    found |= future.result()
                except BrokenExecutor:
                    found |= {
                        episode.number: "the process that played it died"
                        for episode in futures[future]
                    }
                show(len(found))
        except KeyboardInterrupt:
            if isinstance(executor, Processes):
                executor.end_at_once()
            raise
        finally:
            executor.shutdown(cancel_futures=True)
    return found


def episode_batches(episodes: Sequence[Drawn]) -> list[list[Drawn]]:
    """Episodes in lists that are played one after the other: all of a street's film together, since
    it takes seconds to make.
    """
    films: dict[tuple[int, bool], list[Drawn]] = {}
    for episode in (one for one in episodes if one.environment == STREET):
        film = episode.seed, "clutter" in dict(episode.arguments)
        films.setdefault(film, []).append(episode)
    others = [one for one in episodes if one.environment != STREET]
    # Streets come first, so that no worker ends long after the others.
    return [
        *films.values(),
        *(others[start : start + _BATCH] for start in range(0, len(others), _BATCH)),
    ]


def attempt(batch: Sequence[Drawn], source: str) -> Trails:
    """Play a batch in a worker; `source` names the recordings of the replay."""
    return {episode.number: result_or_reason(play_alone, episode, source) for episode in batch}


def play_alone(episode: Drawn, source: str) -> bytes:
    """The trail of an episode."""
    with closing(certified_env(episode, source)) as env:
        policy = begun(episode, env)
        observation, _ = env.reset()
        while not env.over:
            observation = env.step(policy(observation))[0]
        return env.played


def certified_env(episode: Drawn, source: str) -> Trail:
    """The environment of an episode, which keeps its trail."""
    recorded = {"source": source} if episode.environment == REPLAY else {}
    arguments = dict(episode.arguments) | recorded
    return Trail(
        gymnasium.make(f"care_sim:{episode.environment}", disable_env_checker=True, **arguments),
        episode,
    )


def begun(episode: Drawn, env: gymnasium.Env[Any, Any]) -> Policy:
    """The policy of an episode, at its beginning."""
    policy = make_policy(episode.policy, env, **AS_LISTED.get(episode.policy, {}))
    policy.reset()
    return policy
