"""Gymnasium environments; importing `care_sim` registers them."""

import gymnasium

IDS = {
    "CARE-Dartout-v0": "care_sim.envs.closed_loop:DartoutEnv",
    "CARE-Dense-v0": "care_sim.envs.closed_loop:DenseEnv",
    "CARE-CutIn-v0": "care_sim.envs.closed_loop:CutInEnv",
}


def register_all() -> None:
    """Register every environment that is not registered yet."""
    for name, entry_point in IDS.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=entry_point)
