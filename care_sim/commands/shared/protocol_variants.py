"""What is common to the commands that play the paper's closed-loop study in several variants, and
with --source the first-sighting protocol in the same ones.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from care_sim.base.bounds import bounded
from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.either_loop import EitherLoopStudy
from care_sim.commands.shared.selection import check_values, playable
from care_sim.sources.scenes import chosen_scenes
from care_sim.study.play_config import PlayConfig

_CLOSED = ("seeds", "also", "sensors", "tables")
_OPEN = ("policies", "budgets", "floor_seeds")


@dataclass(frozen=True, kw_only=True)
class ProtocolVariants(EitherLoopStudy):
    """A study whose plays of the open loop are those of policies at budgets, in variants."""

    policies: tuple[str, ...] = ()
    """With --source: names of `care-sim policies`; `all` stands for all but the controls. `full`
    always runs with budget 1.0.
    """
    budgets: tuple[float, ...] = (0.03, 0.05, 0.1)
    """With --source: shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    floor_seeds: int = bounded(1, 1, 1000)
    """With --source: number of random floors, over which the counts of a scene are averaged."""

    def check_options(self) -> None:
        """Raise InvalidInput for an option of the other loop."""
        self.check_loop(_CLOSED, _OPEN)

    def play_scenes(
        self, study: str, command: str, plays: Callable[..., Sequence[PlayConfig]], named: str
    ) -> int:
        """Play the scenes of the source that is `named`; `plays` takes the source, scenes, policies
        and budgets, and `floor_seeds` by name.

        Raises InvalidInput where none of the policies can be played.
        """
        check_values(self, "policies", "budgets")
        source = self.source_named(named)
        scenes = chosen_scenes(source.scenes(), self.scenes)
        played = partial(plays, source, floor_seeds=range(self.floor_seeds))
        policies, left_out = playable(
            self.policies, lambda name: played(scenes[:1], [name], self.budgets[:1])
        )
        if not policies:
            raise InvalidInput("none of the policies can be played")
        configs = played(scenes, policies, self.budgets)
        return self.play_study(study, configs, self.name_of(command), left_out)
