"""Gymnasium environments; importing `care_sim` registers them."""

import gymnasium

CLOSED_LOOP = {
    "CARE-Dartout-v0": "care_sim.envs.scenarios:DartoutEnv",
    "CARE-Dense-v0": "care_sim.envs.scenarios:DenseEnv",
    "CARE-CutIn-v0": "care_sim.envs.scenarios:CutInEnv",
    "CARE-R157-v0": "care_sim.envs.scenarios:R157Env",
    "CARE-NCAP-v0": "care_sim.envs.scenarios:NcapEnv",
    "CARE-Drive-v0": "care_sim.envs.scenarios:DriveEnv",
}
OPEN_LOOP = {
    "CARE-Street-v0": "care_sim.envs.scenes:StreetEnv",
    "CARE-Replay-v0": "care_sim.envs.scenes:ReplayEnv",
}
IDS = CLOSED_LOOP | OPEN_LOOP
"""Entry points of all environments, by id."""
_VECTORS = {
    entry_point: entry_point.replace("envs.scenarios", "envs.vector.scenarios").replace(
        "Env", "VectorEnv"
    )
    for entry_point in CLOSED_LOOP.values()
}
"""Entry points of many worlds of each at once."""


def register_all() -> None:
    """Register every environment that is not registered yet."""
    # As strings: an environment and what it needs are imported when one is made.
    for name, entry_point in IDS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name, entry_point=entry_point, vector_entry_point=_VECTORS.get(entry_point)
            )
