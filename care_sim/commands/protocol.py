"""The command of the paper's first-sighting protocol (Secs. 3 and 5)."""

from dataclasses import dataclass
from pathlib import Path

from care_sim.base.bounds import bounded
from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.play_options import PlayOptions
from care_sim.commands.shared.running import Running, in_turn, playable
from care_sim.sources.scenes import chosen_scenes
from care_sim.study.play_config import play_grid

PAPERS = (
    "history",
    "history-uniform",
    "all-camera",
    "uncertainty",
    "beam-reduce",
    "random",
    "care",
    "care-sbf",
    "learned-scorer",
)
"""Those of the paper's Sec. 5.1, and the floor alone."""


@dataclass(frozen=True, kw_only=True)
class Protocol(Running, PlayOptions):
    """Play the paper's first-sighting protocol: every policy over the same keyframes, on streets or
    recordings.
    """

    scenes: tuple[str, ...] = ()
    """One number: that many scenes, from the first. Else scenes by name. All of them, unless
    given."""
    policies: tuple[str, ...] = (*PAPERS, "full")
    """`care-sim policies` lists them; `all`, but for controls. `full` always runs with budget 1.0.
    Allocations are compared with those of `care`, which is played for that in any case."""
    budgets: tuple[float, ...] = (0.1, 0.2, 0.35)
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    floor_seeds: int = bounded(3, 1, 1000)
    """So many random floors, over which the tallies of a scene are averaged."""
    camera_latencies: tuple[int, ...] = ()
    """Several of --camera-latency, in turn; 1 is the paper's strict-causal variant."""
    presence: str = "annotated"
    """Who is present at scene start, and so never a first sighting: whoever is `annotated` there
    (the paper's rule), or only who is `visible`, so that somebody who then stands hidden counts
    when it shows itself."""
    out: Path = Path("runs/protocol")
    """Folder of the results; an interrupted run goes on there."""

    def __call__(self) -> int:
        """Run it."""
        for axis in ("policies", "budgets"):
            if not getattr(self, axis):
                raise InvalidInput(f"--{axis} needs at least one value")
        source = self.scene_source()
        common = self.common() | {"presence": self.presence}
        scenes = chosen_scenes(source.scenes(), self.scenes)
        latencies = in_turn(self.camera_latencies, "camera_latency", common)
        first = common.pop("floor_seed")
        policies, left_out = playable(
            self.policies,
            lambda name: play_grid(source, scenes[:1], [name], self.budgets[:1], **common),
        )
        if not policies:
            raise InvalidInput("none of the policies can be played")
        floors = range(first, first + self.floor_seeds)
        configs = play_grid(source, scenes, policies, self.budgets, floors, latencies, **common)
        return self.conduct("protocol", configs, self.out, left_out)
