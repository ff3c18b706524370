"""`care-sim compare`: the same seed under several policies, as a table, and side by side in a
recording or a film.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, cast

import tyro

from care_sim.base.errors import InvalidInput, report_problems
from care_sim.commands.shared.one_scene import SceneOptions, is_source, scene_plays
from care_sim.commands.shared.options import DEFAULT_OPTIONS, Options
from care_sim.commands.shared.selection import playable
from care_sim.commands.shared.study_command import DONE, FAILED, console
from care_sim.commands.shared.written_files import finish_files
from care_sim.envs.wrappers.record_rerun import RecordRerun, recording
from care_sim.loops.film import Film
from care_sim.reports.episodes.clips import Clip
from care_sim.reports.episodes.timeline import SCENE_LABELS, outcome_text, text
from care_sim.reports.table import Table
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.episode_play import GymEnv, result_or_reason, trace
from care_sim.study.play_config import PlayConfig
from care_sim.study.rows.reading import stops_for_nothing
from care_sim.study.run_config import Row
from care_sim.study.scene_trace import trace_scene
from care_sim.study.world_hash import check_worlds

AnyConfig = EpisodeConfig | PlayConfig
_COLUMNS = {
    "detection_distance_m": "detected at (to actor) m",
    "braked": "braked",
    "min_distance_m": "nearest (centres) m",
    "clearance_m": "clearance (hulls) m",
    "collision": "collision",
    "impact_speed_mps": "impact m/s",
    "rays_fired": "rays fired",
}
_OF_COLLISIONS = {
    "hit_kind": "hit",
    "hit_at_front": "at its front",
    "closing_speed_mps": "closing m/s",
}
_OF_STOPS_FOR_NOTHING = {"braked_before_view": "braked for nothing"}


@dataclass(frozen=True, kw_only=True)
class Compare(SceneOptions):
    """Play one seed under several policies, side by side."""

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """dartout, dense, cutin, ncap, r157, drive, that of an installed package, or MODULE:CLASS;
    `care-sim scenarios` lists their parameters. For the open loop street, argoverse2:FOLDER,
    nuscenes:FOLDER, kitti:FOLDER, sweeps:FOLDER, boreas, or another of `care-sim sources`.
    """
    policies: tuple[str, ...] = ("history", "care")
    """Names of `care-sim policies`; `all` stands for all but the controls. `full` always runs with
    budget 1.0."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""
    seed: int = 0
    """Seed of scenario, camera faults, noise and floor, the same for every policy."""
    record: Path | None = None
    """File (.rrd) for a recording of all episodes, side by side; `care-sim view FILE` plays it
    (extra 'viewer').
    """
    video: Path | None = None
    """File for a film of all episodes, side by side: MP4 (extra 'video'), or animated GIF, WebP or
    PNG, by its ending.
    """
    video_start: float | None = None
    """Start the film this many seconds after the episodes start."""
    conditions: Annotated[Options, tyro.conf.arg(name="")] = DEFAULT_OPTIONS
    """Further conditions."""

    def __call__(self) -> int:
        """Run it."""
        common = self.conditions.arguments(self.policies)

        made = self._plays(common) if is_source(self.scenario) else self._episodes(common)
        policies, left_out = playable(self.policies, lambda name: made([name]))
        if not policies:
            raise InvalidInput("none of the policies can be played")
        failures = play_side_by_side(made(policies), self.record, self.video, self.video_start)
        return FAILED if left_out or failures else DONE

    def _episodes(self, common: dict[str, Any]) -> Callable[[Sequence[str]], list[EpisodeConfig]]:
        """What makes the episodes of policies, in the closed loop."""
        self.check_unused()
        return lambda names: grid([self.scenario], names, [self.budget], [self.seed], **common)

    def _plays(self, common: dict[str, Any]) -> Callable[[Sequence[str]], list[PlayConfig]]:
        """What makes the plays of policies, in a scene of the open loop."""
        source = self.source(self.scenario, self.conditions.sensor)
        scene = self.scene_of(source, self.seed)
        return lambda names: scene_plays(source, scene, names, self.budget, common)


def play_side_by_side(
    configs: Sequence[AnyConfig],
    record: Path | None = None,
    video: Path | None = None,
    video_start: float | None = None,
) -> list[str]:
    """Play episodes one after the other, into one recording and one film where files are given, and
    print their outcomes. A line for each that failed is printed too, and returned.
    """
    film = Clip(video, video_start, panels=True)
    # All plays of a scene meet its one film.
    shown = configs[0].film() if isinstance(configs[0], PlayConfig) else None
    answers: list[Row | str] = []
    try:
        with _recorded(configs, record) as wrapped:

            def played(config: AnyConfig) -> Row:
                watch, wrap = film.episode(config.policy), partial(wrapped, config.policy)
                if isinstance(config, PlayConfig):
                    return trace_scene(config, cast(Film, shown), watch, wrap=wrap).row
                row = trace(config, watch, wrap=wrap)[0]
                film.show_outcome(row)
                return row

            for config in configs:
                # One by one, so that an interrupt leaves those that were played.
                answers.append(result_or_reason(played, config))  # noqa: PERF401
    finally:
        # What was played is printed whatever happens to the others.
        failures = _report(configs, answers)
    finish_files(record, film, video)
    check_worlds(row for row in answers if not isinstance(row, str))
    return failures


def _report(configs: Sequence[AnyConfig], answers: Sequence[Row | str]) -> list[str]:
    # Answers are fewer than configurations where an interrupt came between.
    told = [*zip(configs, answers, strict=False)]
    rows = [(config, row) for config, row in told if not isinstance(row, str)]
    if rows:
        console().print(_outcome_table(rows).rich())
    failures = [
        f"failed: {config.label}: {reason}" for config, reason in told if isinstance(reason, str)
    ]
    report_problems(failures)
    return failures


@contextmanager
def _recorded(configs: Sequence[AnyConfig], record: Path | None) -> Iterator[Callable[..., GymEnv]]:
    """A function of the policy's name, an environment and its policy, which returns the environment
    under the recording; the environment as it is where there is no recording.
    """
    if record is None:
        yield lambda _name, env, _policy: env
        return
    open_loop = isinstance(configs[0], PlayConfig)
    with recording(record, [config.policy for config in configs], open_loop) as shared:
        yield lambda name, env, policy: RecordRerun(env, shared, policy, name)


def _outcome_table(played: Sequence[tuple[AnyConfig, Row]]) -> Table:
    """One line per episode."""
    config = played[0][0]
    if isinstance(config, PlayConfig):
        title, told, written = config.scene.name, SCENE_LABELS, outcome_text
    else:
        title, told = f"{config.scenario} seed {config.seed}", {**_COLUMNS}
        told |= _OF_COLLISIONS if any(row["collision"] for _, row in played) else {}
        told |= _OF_STOPS_FOR_NOTHING if any(stops_for_nothing(row) for _, row in played) else {}
        written = _text_of
    lines = [
        (config.policy, f"{config.budget:.4g}", *(written(row, name) for name in told))
        for config, row in played
    ]
    columns = ("policy", "budget", *told.values())
    return Table(title, columns, tuple(lines), whole=columns)


def _text_of(row: Row, name: str) -> str:
    return text(row[name])
