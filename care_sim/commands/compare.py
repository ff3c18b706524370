"""`care-sim compare`: the same seed under several policies, as a table, and side by side in a
recording or a film.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import cast

from care_sim.base.errors import report_problems
from care_sim.base.interrupts import DONE, FAILED
from care_sim.commands.options.watching import Compare
from care_sim.commands.shared.console import TableConsole
from care_sim.commands.shared.one_scene import finish_files, maker_of
from care_sim.commands.shared.selection import playable
from care_sim.envs.wrappers.record_rerun import RecordRerun, recording
from care_sim.loops.film import Film
from care_sim.reports.episodes.clips import Clip
from care_sim.reports.episodes.timeline import SCENE_LABELS, outcome_text
from care_sim.reports.table import Table
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import GymEnv, result_or_reason, trace
from care_sim.study.play_config import PlayConfig
from care_sim.study.rows.checks import check_worlds
from care_sim.study.rows.reading import stops_for_nothing
from care_sim.study.run_config import Row
from care_sim.study.scene_play import trace_scene

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


def compare(options: Compare) -> int:
    """Play one seed under several policies, and print their outcomes."""
    made = maker_of(options, options.scenario, options.policies, options.budget)
    policies, left_out = playable(options.policies, lambda name: made([name]))
    failures = play_side_by_side(made(policies), options.record, options.video, options.video_start)
    return FAILED if left_out or failures else DONE


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
        # Print the episodes that were played, whatever happens to the others.
        failures = _report(configs, answers)
    finish_files(record, film, video)
    check_worlds(row for row in answers if not isinstance(row, str))
    return failures


def _report(configs: Sequence[AnyConfig], answers: Sequence[Row | str]) -> list[str]:
    # Answers are fewer than configurations where an interrupt came between.
    told = [*zip(configs, answers, strict=False)]
    rows = [(config, row) for config, row in told if not isinstance(row, str)]
    if rows:
        TableConsole().print(_outcome_table(rows).rich())
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
        title, told = config.scene.name, SCENE_LABELS
    else:
        title, told = f"{config.scenario} seed {config.seed}", {**_COLUMNS}
        told |= _OF_COLLISIONS if any(row["collision"] for _, row in played) else {}
        told |= _OF_STOPS_FOR_NOTHING if any(stops_for_nothing(row) for _, row in played) else {}
    lines = [
        (config.policy, f"{config.budget:.4g}", *(outcome_text(row, name) for name in told))
        for config, row in played
    ]
    columns = ("policy", "budget", *told.values())
    return Table(title, columns, tuple(lines), whole=columns)
