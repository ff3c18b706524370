"""Whether the engine `fast` answers as Bullet does: `care-sim parity`."""

from care_sim.parity.config import ParityConfig
from care_sim.parity.run import run

__all__ = ["ParityConfig", "run"]
