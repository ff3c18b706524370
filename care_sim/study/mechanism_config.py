"""The configuration of a mechanism's row: a play of the open loop, and the policy on whose belief
all others are asked.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

from care_sim.base.errors import InvalidInput
from care_sim.policies import check_policy
from care_sim.sources.scenes import Scene, Source
from care_sim.study.play_config import PlayConfig, play_grid
from care_sim.study.run_config import FULL, REFERENCE, Row, check_size, parameters_for


@dataclass(frozen=True)
class MechanismConfig(PlayConfig):
    """A play of `policy`, which is also asked what it would fire on the belief of `driver`, the
    policy that plays there. Raises InvalidInput as `PlayConfig` does, and for a driver that cannot
    be one.
    """

    driver: str = REFERENCE

    def __post_init__(self) -> None:
        check_policy(self.driver)
        # Its budget is all cells, so that nobody could differ from it at the budget that is asked.
        if self.driver == FULL:
            raise InvalidInput(f"driver must be a policy with a budget, got {FULL!r}")
        super().__post_init__()

    @classmethod
    def of(cls, play: PlayConfig, driver: str) -> Self:
        """The same play, with a driver."""
        own = {field.name: getattr(play, field.name) for field in fields(PlayConfig)}
        return cls(**own, driver=driver)

    def row(self) -> Row:
        """Every parameter flat."""
        return super().row() | {"driver": self.driver}


def mechanism_plays(
    source: Source,
    scenes: Sequence[Scene],
    policies: Sequence[str],
    *,
    budget: float,
    driver: str,
    **common: Any,
) -> list[MechanismConfig]:
    """The driver, the `policies` and the full scan, scene by scene; `common` are further fields of
    `PlayConfig`, but for the floor, of which there is one.

    Raises InvalidInput for parameters of the driver: all rows of a scene name one driver, and none
    has a column for them.
    """
    if own := parameters_for(driver, common.get("policy_parameters", ())):
        raise InvalidInput(
            f"the driver {driver} plays without parameters, got {own[0][0]}: give those of another "
            "policy as POLICY.NAME=VALUE"
        )
    everyone = dict.fromkeys([driver, *policies, FULL])
    check_size(len(scenes) * len(everyone))
    # One scene's are checked, and the others are the same in another scene.
    floor_seed = common.pop("floor_seed", 0)
    first = [
        MechanismConfig.of(play, driver)
        for play in play_grid(source, scenes[:1], everyone, [budget], [floor_seed], **common)
    ]
    return [config.of_scene(scene, config.floor_seed) for scene in scenes for config in first]
