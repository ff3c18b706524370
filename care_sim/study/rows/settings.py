"""What rows have in common that may be compared: one `Setting` for the closed and the open loop."""

from dataclasses import dataclass, replace
from typing import Any

from care_sim.core.conditions import CAMERA_FAULTS, UNUSED_BY_FULL_SCAN
from care_sim.perception.detectors import PROXY

ChangedConditions = tuple[tuple[str, Any], ...]
"""Names and values of the conditions that are not the default."""
SOURCES = {
    "streets": "generated streets",
    "argoverse2": "Argoverse 2",
    "nuscenes": "nuScenes",
    "kitti": "KITTI",
    "boreas": "Boreas",
}
"""How headings name the sources of films."""
WITHOUT_LABELS = "sweeps"
"""The source that a detector annotates."""


@dataclass(frozen=True, order=True)
class Setting:
    """Where rows were played, and the conditions in which they depart from the defaults.

    `world` is a scenario in the closed loop and a source of films in the open loop. `detector` is
    that of the open loop with its parameters, empty in the closed loop, where another than the
    default is among the conditions.
    """

    world: str
    conditions: ChangedConditions = ()
    detector: str = ""

    @property
    def faults(self) -> bool:
        """Whether the camera is impaired."""
        return any(name in CAMERA_FAULTS for name, _ in self.conditions)

    @property
    def strict_causal(self) -> bool:
        """Whether it is the paper's strict-causal variant (Sec. 3): the camera one keyframe old.

        The paper defines it in the open loop alone.
        """
        # Only the open loop has a detector here.
        return bool(self.detector) and self.conditions == (("camera_latency", 1),)

    @property
    def has_paper(self) -> bool:
        """Whether the paper's figures stand beside those of these films: of generated streets and
        recordings, not of a source of one's own, of which it says nothing.
        """
        return self.world in SOURCES

    @property
    def as_in_paper(self) -> bool:
        """Whether these are films beside which its figures stand, under the default conditions."""
        return self.has_paper and not self.conditions

    @property
    def label(self) -> str:
        """A heading."""
        changed = [f"{name.replace('_', ' ')} {value}" for name, value in self.conditions]
        if self.strict_causal:
            changed = ["strict-causal (camera one keyframe old)"]
        if not self.detector:
            return ", ".join([self.world, *changed])
        return ", ".join(
            [SOURCES.get(self.world, self.world), f"detector {self.detector}", *changed]
        )

    @property
    def slug(self) -> str:
        """A part of a file's name, beginning with the world."""
        detector = [] if self.detector in ("", PROXY) else [self.detector]
        changed = [f"{name}-{value}" for name, value in self.conditions]
        text = "-".join([self.world, *detector, *changed])
        # Every other sign may mean something to a file system or a shell.
        return "".join(sign if sign.isalnum() or sign in ".-" else "-" for sign in text)

    def for_full(self) -> "Setting":
        """The setting in which the full scan of the same world is found."""
        felt = (pair for pair in self.conditions if pair[0] not in UNUSED_BY_FULL_SCAN)
        return replace(self, conditions=tuple(felt))
