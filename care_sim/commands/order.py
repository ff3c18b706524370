"""`care-sim order`: what the order of cells inside a set decides."""

from dataclasses import dataclass
from functools import partial

from care_sim.base.bounds import bounded
from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.either_loop import EitherLoopStudy
from care_sim.commands.shared.selection import check_values, playable
from care_sim.sources.scenes import chosen_scenes
from care_sim.study.designs.order import order_plays, order_study

_CLOSED = ("seeds", "also")
_OPEN = ("policies", "budgets", "floor_seeds")


@dataclass(frozen=True, kw_only=True)
class Order(EitherLoopStudy):
    """Play the paper's closed-loop study under every order of the cells inside a set, 279
    configurations per seed and those of --also, or with --source the first-sighting protocol, and
    list what the paper says order by order.
    """

    policies: tuple[str, ...] = (
        "history",
        "all-camera",
        "care",
        "care-sbf",
        "care-sightlines",
        "care-sector",
        "learned-scorer",
        "history-place",
        "full",
    )
    """With --source: names of `care-sim policies`; `all` stands for all but the controls. `full`
    always runs with budget 1.0.
    """
    budgets: tuple[float, ...] = (0.03, 0.05, 0.1)
    """With --source: shares of the cells that may fire at a keyframe, above 0 and at most 1."""
    floor_seeds: int = bounded(1, 1, 1000)
    """With --source: number of random floors, over which the counts of a scene are averaged."""

    def __call__(self) -> int:
        """Run it."""
        self.check_loop(_CLOSED, _OPEN)
        if self.source is None:
            return self.play("order", order_study, self.folder("order"))
        return self._play_scenes(self.source)

    def _play_scenes(self, named: str) -> int:
        check_values(self, "policies", "budgets")
        source = self.source_named(named)
        scenes = chosen_scenes(source.scenes(), self.scenes)
        plays = partial(order_plays, source, floor_seeds=range(self.floor_seeds))
        policies, left_out = playable(
            self.policies, lambda name: plays(scenes[:1], [name], self.budgets[:1])
        )
        if not policies:
            raise InvalidInput("none of the policies can be played")
        configs = plays(scenes, policies, self.budgets)
        return self.play_study("order-open-loop", configs, self.folder("order"), left_out)
