"""`care-sim mechanism`: why policies differ, on one shared belief and ray by ray."""

from collections.abc import Sequence
from dataclasses import dataclass

from care_sim.commands.shared.play_options import PlayOptions, named_after
from care_sim.commands.shared.selection import playable
from care_sim.commands.shared.study_command import StudyCommand
from care_sim.sources.scenes import Scene, chosen_scenes
from care_sim.study.mechanism_config import MechanismConfig, mechanism_plays
from care_sim.study.run_config import REFERENCE


@dataclass(frozen=True, kw_only=True)
class Mechanism(StudyCommand, PlayOptions):
    """Find why one policy finds what another misses, ray by ray.

    Find why policies differ: on one shared belief, and ray by ray, on streets or recordings.
    """

    scenes: tuple[str, ...] = ()
    """One number: that many scenes, from the first. Otherwise names of scenes. Without this
    option, all scenes."""
    policies: tuple[str, ...] = ("history", "all-camera", "care")
    """Names of `care-sim policies`; `all` stands for all but the controls. The driver and `full`
    play in any case."""
    driver: str = REFERENCE
    """The policy that plays where the others are asked: the belief is its own."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""
    presence: str = "annotated"
    """As in `care-sim protocol`: who is present at scene start, and so no first sighting."""

    def __call__(self) -> int:
        """Run it."""
        source = self.scene_source()
        common = self.common((*self.policies, self.driver)) | {"presence": self.presence}
        scenes = chosen_scenes(source.scenes(), self.scenes)

        def plays(scenes: Sequence[Scene], policies: Sequence[str]) -> list[MechanismConfig]:
            return mechanism_plays(
                source, scenes, policies, budget=self.budget, driver=self.driver, **common
            )

        policies, left_out = playable(self.policies, lambda name: plays(scenes[:1], [name]))
        configs = plays(scenes, policies)
        return self.play_study(
            "mechanism", configs, named_after("mechanism", self.source), left_out
        )
