"""`care-sim compare`: the same seed under several policies, as a table, and side by side in a
recording or a film.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from care_sim.base.errors import InvalidInput, report_problems
from care_sim.commands.shared.options import DEFAULT_OPTIONS, Options
from care_sim.commands.shared.selection import playable
from care_sim.commands.shared.study_command import DONE, FAILED, console
from care_sim.envs.wrappers.record_rerun import RecordRerun, recording
from care_sim.reports.episodes.clips import Clip
from care_sim.reports.episodes.timeline import text
from care_sim.reports.table import Table
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.episode_play import GymEnv, result_or_reason, trace
from care_sim.study.run_config import Row
from care_sim.viewer.pictures.comparison import draw_panel

_COLUMNS = {
    "detection_distance_m": "detected at (to actor) m",
    "braked": "braked",
    "min_distance_m": "nearest (centres) m",
    "clearance_m": "clearance (hulls) m",
    "collision": "collision",
    "impact_speed_mps": "impact m/s",
    "rays_fired": "rays fired",
}


@dataclass(frozen=True, kw_only=True)
class Compare:
    """Play one seed under several policies, side by side.

    Play the same seed under several policies and print their outcomes side by side.
    """

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """dartout, dense, cutin, ncap, r157, drive, that of an installed package, or MODULE:CLASS;
    `care-sim scenarios` lists their parameters.
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
    conditions: Annotated[Options, tyro.conf.arg(name="")] = DEFAULT_OPTIONS
    """Further conditions."""

    def __call__(self) -> int:
        """Run it."""
        common = self.conditions.arguments(self.policies)

        def made(names: Sequence[str]) -> list[EpisodeConfig]:
            return grid([self.scenario], names, [self.budget], [self.seed], **common)

        policies, left_out = playable(self.policies, lambda name: made([name]))
        if not policies:
            raise InvalidInput("none of the policies can be played")
        failures = play_side_by_side(made(policies), self.record, self.video)
        return FAILED if left_out or failures else DONE


def play_side_by_side(
    configs: Sequence[EpisodeConfig], record: Path | None = None, video: Path | None = None
) -> list[str]:
    """Play episodes one after the other, into one recording and one film where files are given, and
    print their outcomes. A line for each that failed is printed too, and returned.
    """
    film = Clip(video, draw_panel)
    answers: list[Row | str] = []
    try:
        with _recorded(configs, record) as wrapped:

            def played(config: EpisodeConfig) -> Row:
                return trace(
                    config, film.episode(config.policy), wrap=partial(wrapped, config.policy)
                )[0]

            for config in configs:
                # One by one, so that an interrupt leaves those that were played.
                answers.append(result_or_reason(played, config))  # noqa: PERF401
    finally:
        # What was played is printed whatever happens to the others.
        failures = _report(configs, answers)
    if record is not None:
        print(f"Recorded in {record}: care-sim view {record}")
    if film.write():
        print(f"Filmed in {video}")
    return failures


def _report(configs: Sequence[EpisodeConfig], answers: Sequence[Row | str]) -> list[str]:
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
def _recorded(
    configs: Sequence[EpisodeConfig], record: Path | None
) -> Iterator[Callable[..., GymEnv]]:
    """A function of the policy's name, an environment and its policy, which returns the environment
    under the recording; the environment as it is where there is no recording.
    """
    if record is None:
        yield lambda _name, env, _policy: env
        return
    with recording(record, [config.policy for config in configs]) as shared:
        yield lambda name, env, policy: RecordRerun(env, shared, policy, name)


def _outcome_table(played: Sequence[tuple[EpisodeConfig, Row]]) -> Table:
    """One line per episode."""
    config = played[0][0]
    lines = [
        (config.policy, f"{config.budget:.4g}", *(text(row[name]) for name in _COLUMNS))
        for config, row in played
    ]
    columns = ("policy", "budget", *_COLUMNS.values())
    return Table(f"{config.scenario} seed {config.seed}", columns, tuple(lines), whole=columns)
