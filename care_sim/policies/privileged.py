"""What a privileged policy is: one that is handed truth, through a door of its own."""

from typing import ClassVar

from care_sim.core.rig import Rig
from care_sim.loops.truth import Truth
from care_sim.policies.base import Policy


class PrivilegedPolicy(Policy):
    """A policy that may ask for the truth about the coming keyframe: a bound or a reference, no
    policy of a car.

    `make_policy` hands `truth` to subclasses of this class and to nobody else. They are never
    tagged causal, and always privileged or non-causal, whatever they claim.
    """

    tags: ClassVar[tuple[str, ...]] = ("privileged",)

    def __init_subclass__(cls, **options: object) -> None:
        super().__init_subclass__(**options)
        honest = tuple(tag for tag in cls.tags if tag != "causal")
        cls.tags = honest if {"privileged", "non-causal"} & {*honest} else ("privileged", *honest)

    def __init__(self, rig: Rig, truth: Truth):
        super().__init__(rig)
        self.truth = truth
