"""The same seed under several policies: a table, and a recording or a film with one beside the other."""

from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from care_sim.errors import InvalidInput
from care_sim.study.options import USUAL, Options
from care_sim.study.running import DONE, FAILED, console, playable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from rich.table import Table

    from care_sim.study.config import EpisodeConfig
    from care_sim.study.episode import Environment
    from care_sim.study.task import Row

COLUMNS = {
    "detection_distance_m": "detected at\n(sensor to actor) m",
    "braked": "braked",
    "min_distance_m": "nearest\n(centres) m",
    "clearance_m": "clearance\n(hulls) m",
    "collision": "collision",
    "impact_speed_mps": "impact\nm/s",
    "rays_fired": "rays\nfired",
}


@dataclass(frozen=True, kw_only=True)
class Compare:
    """Play the same seed under several policies and print their outcomes side by side."""

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """dartout, dense or cutin; `care-sim scenarios` lists them."""
    policies: tuple[str, ...] = ("history", "care")
    """`care-sim policies` lists them; `all`. `full` always runs with budget 1.0."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""
    seed: int = 0
    """Draws scenario, camera faults, noise and floor: the same for every policy."""
    record: Path | None = None
    """File (.rrd) for a recording of all, side by side; `care-sim view FILE` plays it (extra 'viewer')."""
    video: Path | None = None
    """File for a film of all, side by side: MP4 (extra 'video'), or animated GIF, WebP or PNG, by its ending."""
    conditions: Annotated[Options, tyro.conf.arg(name="")] = USUAL
    """Further conditions."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.study.config import grid

        def made(names: "Sequence[str]") -> "list[EpisodeConfig]":
            return grid([self.scenario], names, [self.budget], [self.seed], **self.conditions.arguments())

        policies, left_out = playable(self.policies, lambda name: made([name]))
        if not policies:
            raise InvalidInput("none of the policies can be played")
        configs = made(policies)
        console().print(outcomes(configs, play(configs, self.record, self.video)))
        if self.record is not None:
            print(f"Recorded in {self.record}: care-sim view {self.record}")
        if self.video is not None:
            print(f"Filmed in {self.video}")
        return FAILED if left_out else DONE


def play(configs: "Sequence[EpisodeConfig]", record: Path | None = None, video: Path | None = None) -> "list[Row]":
    """Play one after the other, into one recording and one film if there are to be any; their rows."""
    from care_sim.study.episode import trace
    from care_sim.study.filming import SideBySide

    film = SideBySide(video)
    with _recorded(configs, record) as wrapped:
        rows = [trace(config, film.panel(config.policy), wrap=partial(wrapped, config.policy))[0] for config in configs]
    film.write()
    return rows


@contextmanager
def _recorded(configs: "Sequence[EpisodeConfig]", record: Path | None) -> "Iterator[Callable[..., Environment]]":
    """What puts an environment, with its policy and the policy's name, under the recording; or leaves it as it is."""
    if record is None:
        yield lambda _name, env, _policy: env
        return
    from care_sim.viewer.wrapper import RecordRerun, recording

    with recording(record, [config.policy for config in configs]) as shared:
        yield lambda name, env, policy: RecordRerun(env, shared, policy, name)


def outcomes(configs: "Sequence[EpisodeConfig]", rows: "Sequence[Row]") -> "Table":
    """A line an episode."""
    from rich.table import Table

    from care_sim.study.timeline import text

    table = Table(title=f"{configs[0].scenario} seed {configs[0].seed}", title_justify="left", box=None)
    for column in ("policy", "budget", *COLUMNS.values()):
        table.add_column(column, justify="left" if column == "policy" else "right", no_wrap=True)
    for config, row in zip(configs, rows, strict=True):
        table.add_row(config.policy, f"{config.budget:.4g}", *(text(row[name]) for name in COLUMNS))
    return table
