"""`care-sim protocol`: the paper's first-sighting protocol (Secs. 3 and 5)."""

from dataclasses import dataclass

from care_sim.base.bounds import bounded
from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.play_options import PlayOptions, named_after
from care_sim.commands.shared.selection import check_values, in_turn, playable
from care_sim.commands.shared.study_command import StudyCommand
from care_sim.sources.scenes import chosen_scenes
from care_sim.study.play_config import play_grid

_PAPER_POLICIES = (
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
"""The policies of the paper's Sec. 5.1, and `random`, the floor alone."""
_CONTROLS = ("rows", "place")
"""The best patterns without a camera."""


@dataclass(frozen=True, kw_only=True)
class Protocol(StudyCommand, PlayOptions):
    """Play the first-sighting protocol, on streets or recordings.

    Play the paper's first-sighting protocol: every policy over the same keyframes, on streets or
    recordings.
    """

    scenes: tuple[str, ...] = ()
    """One number: that many scenes, from the first. Otherwise names of scenes. Without this
    option, all scenes."""
    policies: tuple[str, ...] = (*_PAPER_POLICIES, "care-sightlines", *_CONTROLS, "full")
    """Names of `care-sim policies`; `all` stands for all but the controls. `full` always runs with
    budget 1.0. Allocations are compared with those of `care`, which is played for that in any case.
    """
    budgets: tuple[float, ...] = (0.1, 0.2, 0.35)
    """Shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    floor_seeds: int = bounded(3, 1, 1000)
    """Number of random floors, over which the counts of a scene are averaged."""
    camera_latencies: tuple[int, ...] = ()
    """Several values of --camera-latency, in turn; 1 is the paper's strict-causal variant."""
    presence: str = "annotated"
    """Objects that are present at scene start are never first sightings. `annotated`: all that are
    annotated there are present (the paper's rule). `visible`: only those that are visible there
    are: an object hidden at the start counts when it first shows."""

    def __call__(self) -> int:
        """Run it."""
        check_values(self, "policies", "budgets")
        source = self.scene_source()
        common = self.common(self.policies) | {"presence": self.presence}
        scenes = chosen_scenes(source.scenes(), self.scenes)
        latencies = in_turn(self.camera_latencies, "camera_latency", common)
        # The floors of a scene have consecutive seeds, from --floor-seed on.
        first = common.pop("floor_seed")
        policies, left_out = playable(
            self.policies,
            lambda name: play_grid(source, scenes[:1], [name], self.budgets[:1], **common),
        )
        if not policies:
            raise InvalidInput("none of the policies can be played")
        floors = range(first, first + self.floor_seeds)
        configs = play_grid(source, scenes, policies, self.budgets, floors, latencies, **common)
        return self.play_study("protocol", configs, named_after("protocol", self.source), left_out)
