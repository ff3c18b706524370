"""The vector environments of the closed loop by id: one per scenario."""

from care_sim.envs import scenarios
from care_sim.envs.vector.env import ClosedLoopVectorEnv


class DartoutVectorEnv(ClosedLoopVectorEnv):
    """`CARE-Dartout-v0` many times."""

    single = scenarios.DartoutEnv


class DenseVectorEnv(ClosedLoopVectorEnv):
    """`CARE-Dense-v0` many times."""

    single = scenarios.DenseEnv


class CutInVectorEnv(ClosedLoopVectorEnv):
    """`CARE-CutIn-v0` many times."""

    single = scenarios.CutInEnv


class R157VectorEnv(ClosedLoopVectorEnv):
    """`CARE-R157-v0` many times."""

    single = scenarios.R157Env


class NcapVectorEnv(ClosedLoopVectorEnv):
    """`CARE-NCAP-v0` many times."""

    single = scenarios.NcapEnv


class DriveVectorEnv(ClosedLoopVectorEnv):
    """`CARE-Drive-v0` many times."""

    single = scenarios.DriveEnv


class ScenarioVectorEnv(ClosedLoopVectorEnv):
    """Any scenario of the closed loop many times."""

    single = scenarios.ScenarioEnv
