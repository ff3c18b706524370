"""`care-sim ablate`: the paper's ablations, one thing varied at a time."""

from dataclasses import dataclass

from care_sim.commands.shared.either_loop import EitherLoopStudy
from care_sim.commands.shared.selection import check_values, playable
from care_sim.sources.scenes import chosen_scenes
from care_sim.study.designs.ablations import ablation_plays, ablation_study, quarter_of


@dataclass(frozen=True, kw_only=True)
class Ablate(EitherLoopStudy):
    """Vary one thing at a time, as the paper's ablations do.

    Vary one thing at a time as the paper's ablations do, one table per thing varied; with
    --source in the open loop, on a quarter of the scenes.
    """

    budgets: tuple[float, ...] = (0.1, 0.2, 0.35)
    """With --source: shares of the cells that may fire at a keyframe, above 0 and at most 1."""

    def __call__(self) -> int:
        """Run it."""
        self.check_loop(("seeds",), ("budgets",))
        if self.source is None:
            return self.play("ablate", ablation_study, self.name_of("ablate"))
        return self._play_scenes(self.source)

    def _play_scenes(self, named: str) -> int:
        check_values(self, "budgets")
        source = self.source_named(named)
        scenes = chosen_scenes(quarter_of(source.scenes()), self.scenes)
        # No pattern by itself: it feels none of what is varied.
        also, left_out = playable(
            self.also or (),
            lambda name: ablation_plays(source, scenes[:1], self.budgets[:1], [name]),
        )
        configs = ablation_plays(source, scenes, self.budgets, also)
        return self.play_study("ablate-open-loop", configs, self.name_of("ablate"), left_out)
