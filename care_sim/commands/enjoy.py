"""`care-sim enjoy`: an episode of a trained agent, to be watched."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

import tyro

from care_sim.base.errors import report_problems
from care_sim.base.extras import import_rerun
from care_sim.commands.run import Run, Watched
from care_sim.commands.shared.agent_play import AgentPlay
from care_sim.commands.view import View
from care_sim.training.agents import find_agent

_RECORD = Path("runs/enjoy.rrd")


@dataclass(frozen=True, kw_only=True)
class Enjoy(Watched):
    """Play a trained agent: timeline, clip, recording or viewer.

    Play one episode of a trained agent, where it learned unless told otherwise: timeline, clip,
    recording or viewer. Of several environments that is the first, without drawn faults. What it
    learned with counts where an option has its default; with --scenario it does not count at all.
    """

    agent: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="AGENT")]
    """A folder of `care-sim train`, a file of weights, or a name of `care-sim agents`."""
    scenario: str | None = None
    """Another scenario than that of its training, or a source of scenes, as `care-sim run` takes
    them."""
    budget: float | None = None
    """Share of the cells that may fire at a keyframe; without it the first of its training."""
    view: bool = False
    """Open the viewer on the recording once the episode is played (extra 'viewer'); without
    --record it is runs/enjoy.rrd."""

    def __call__(self) -> int:
        """Run it."""
        if not self.view:
            return self._run(self.record)
        import_rerun()
        record = self.record or _RECORD
        record.parent.mkdir(parents=True, exist_ok=True)
        return self._run(record) or View(file=record)()

    def _run(self, record: Path | None) -> int:
        play = AgentPlay(find_agent(self.agent))
        elsewhere = self.scenario is not None
        if not elsewhere and (names := play.left_out()):
            report_problems([f"played without what no command takes: {', '.join(names)}"])
        given = {one.name: getattr(self, one.name) for one in fields(Watched)}
        scene = {} if elsewhere else play.scene
        told = {name: value for name, value in scene.items() if given[name] is None}
        return Run(
            **given
            | told
            | {
                "scenario": self.scenario if elsewhere else play.world,
                "policy": play.agent.policy,
                "budget": play.agent.budget if self.budget is None else self.budget,
                "record": record,
                "conditions": play.options(self.conditions, only_agent=elsewhere),
            }
        )()
