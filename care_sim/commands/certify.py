"""`care-sim certify`: whether episodes go on this machine as published."""

from dataclasses import dataclass

from care_sim.measure.certify.run import CertifyConfig, run_certify


@dataclass(frozen=True, kw_only=True)
class Certify(CertifyConfig):
    """Play published episodes and say whether they go as published.

    Play a published list of episodes and say whether they go as published, or where one does
    not.

    The list holds every environment, built-in policy and fault, alone and in every kind of vector.
    """

    def __call__(self) -> int:
        """Run it."""
        return run_certify(self)
