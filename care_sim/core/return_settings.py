"""What becomes of a LiDAR's pulses on their way there and back, one switch for each effect.

Every switch is off by default: then each fired cell returns what its ray meets within reach. The
formulas lie in `care_sim.sensors`, each with its source; `docs/returns.md` shows them together.
"""

from dataclasses import dataclass, fields
from typing import Any

from care_sim.base.bounds import bounded, check_fields, one_of
from care_sim.base.errors import InvalidInput

STRONGEST, LAST, BOTH = "strongest", "last", "both"
RETURNS_KEPT = (STRONGEST, LAST, BOTH)
"""Which echoes of a beam a sensor reports."""
_NEEDS = {
    "lidar_stated_reflectance": "lidar_stated_range_m",
    "visibility_m": "lidar_stated_range_m",
    "rain_mm_h": "lidar_stated_range_m",
    "lidar_returns": "lidar_divergence_mrad",
    "lidar_compensated": "lidar_sweep_s",
}
"""Settings that say nothing unless another one is switched on."""
_LEAST_M = 0.01
"""Metres. The formulas divide by a range and by a visibility: nearer to 0 they would overflow."""


@dataclass(frozen=True, kw_only=True)
class ReturnSettings:
    """Which pulses come back, and what they tell. Raises InvalidInput for a value out of its bounds
    and for a setting that has no meaning without another one.
    """

    lidar_stated_range_m: float = bounded(0.0, 0, 10_000)
    """From here a target of `lidar_stated_reflectance` that faces the LiDAR returns just enough, in
    clear air, metres, 0.01 at least: a line of every data sheet. A return is then as strong as its
    surface and its distance make it (`care_sim.sensors.signal`), and weaker ones are lost. At 0
    none is.
    """
    lidar_stated_reflectance: float = bounded(0.1, 0.001, 1)
    """Reflectance of the target at `lidar_stated_range_m`, 0 to 1; most data sheets take 0.1."""
    visibility_m: float = bounded(0.0, 0, 1_000_000)
    """Meteorological visibility in fog, metres, 0.01 at least (`care_sim.sensors.signal`); 0 is
    clear air. The cameras see on as before.
    """
    rain_mm_h: float = bounded(0.0, 0, 1000)
    """Rain, millimetres per hour (`care_sim.sensors.signal`). The cameras see on as before."""
    lidar_divergence_mrad: float = bounded(0.0, 0, 100)
    """Angle between opposite edges of a beam, milliradians (`care_sim.sensors.beams`). A beam may
    then meet several bodies. At 0 it is one ray.
    """
    lidar_returns: str = one_of(STRONGEST, RETURNS_KEPT)
    """Which echo a beam returns that has several: `strongest`, `last` or `both`
    (`care_sim.sensors.signal`).
    """
    lidar_sweep_s: float = bounded(0.0, 0, 1)
    """How long a sweep takes, seconds: columns fire one after another, the last at the keyframe
    (`care_sim.sensors.beams`). At 0 all fire at once.
    """
    lidar_compensated: bool = False
    """Whether points of a sweep are moved by how the ego moved since. Ranges stay as measured."""
    lidar_crosstalk: float = bounded(0.0, 0, 1)
    """Share of the cells that take the pulse of another LiDAR for their return, 0 to 1
    (`care_sim.sensors.lidar_faults`).
    """

    def __post_init__(self) -> None:
        check_fields(self)
        self.check_returns()

    @property
    def shapes_beams(self) -> bool:
        """Whether a ray alone does not tell what a cell returns."""
        return bool(self.lidar_stated_range_m or self.lidar_divergence_mrad or self.lidar_sweep_s)

    def check_returns(self) -> None:
        """Raise InvalidInput for a setting that has no meaning without another one, and for a
        distance too near to 0.
        """
        changed = [n for n, usual in RETURN_SETTINGS.items() if getattr(self, n) != usual]
        for name in ("lidar_stated_range_m", "visibility_m"):
            if 0 < getattr(self, name) < _LEAST_M:
                raise InvalidInput(
                    f"{name} must be 0 or at least {_LEAST_M:g}, got {getattr(self, name):g}"
                )
        for name in changed:
            if (needed := _NEEDS.get(name, name)) not in changed:
                raise InvalidInput(f"{name} has no meaning without {needed}")


RETURN_SETTINGS: dict[str, Any] = {field.name: field.default for field in fields(ReturnSettings)}
"""Their names and defaults."""


@dataclass(frozen=True, kw_only=True)
class FilmedReturns(ReturnSettings):
    """How pulses return in a film, without crosstalk, which is drawn when it is played. It holds
    what returns to a cell that is fired up to `most_shots` times.
    """

    most_shots: int = 1


RAYS = FilmedReturns()
"""All switches off."""


def changed_settings(settings: ReturnSettings, usual: ReturnSettings) -> list[str]:
    """The names of those in which two differ."""
    return [name for name in RETURN_SETTINGS if getattr(settings, name) != getattr(usual, name)]
