"""`care-sim order`: what the order of cells inside a set decides."""

from dataclasses import dataclass

from care_sim.commands.shared.protocol_variants import ProtocolVariants
from care_sim.study.designs.order import order_plays, order_study


@dataclass(frozen=True, kw_only=True)
class Order(ProtocolVariants):
    """Play the paper's study under every order of cells in a set.

    Play the paper's closed-loop study under every order of the cells inside a set, 279
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

    def __call__(self) -> int:
        """Run it."""
        self.check_options()
        if self.source is None:
            return self.play("order", order_study, self.name_of("order"))
        return self.play_scenes("order-open-loop", "order", order_plays, self.source)
