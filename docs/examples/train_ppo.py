"""Proximal policy optimisation (Stable-Baselines3) that ranks sectors for the LiDAR's reserve.

    python docs/examples/train_ppo.py        # two minutes of one core; needs the extra rl

The settings matter: with Stable-Baselines3's own ones the agent learns nothing in these steps.
`care-sim train ppo` keeps checkpoints too, and makes the weights a policy of the benchmark.
"""

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

import care_sim  # noqa: F401 (registers the environments)
from care_sim.training.seeds import VectorTrainingSeeds
from care_sim.training.vec_env import GymnasiumVecEnv
from care_sim.wrappers import VectorGridObservation, VectorSectorReserve

WORLDS, STEPS, RATE = 8, 100_000, 1e-3
VALIDATION_SEEDS = 2_000  # training takes seeds from 10,000 on by itself


def make_worlds() -> gym.vector.VectorEnv:
    """Dense streets at 3% of the cells, rewarded for detecting as early as a full scan would."""
    return gym.make_vec(
        "CARE-Dense-v0",
        num_envs=WORLDS,
        autoreset_mode="Disabled",
        budget=0.03,
        reward_weights={"gain": 10.0},
    )


def make_model(rate: float) -> PPO:
    """A learner whose steps, discount and noise fit these short episodes."""
    worlds = VectorGridObservation(VectorSectorReserve(VectorTrainingSeeds(make_worlds())))
    return PPO(
        "MultiInputPolicy",
        VecMonitor(GymnasiumVecEnv(worlds)),
        n_steps=128,
        batch_size=256,
        n_epochs=4,
        learning_rate=rate,
        gamma=0.9,
        policy_kwargs={"log_std_init": -1.2},
        seed=0,
        device="cpu",
    )


def distance_m(model: PPO) -> float:
    """The mean distance of the first detection in validation seeds; 0 m where there is none."""
    worlds = VectorGridObservation(VectorSectorReserve(make_worlds()))
    observation, _ = worlds.reset(seed=VALIDATION_SEEDS)
    found, ended = np.zeros(WORLDS), np.zeros(WORLDS, bool)
    while not ended.all():
        scores, _ = model.predict(observation, deterministic=True)
        scores = scores.reshape(worlds.action_space.shape)
        observation, _, terminated, truncated, info = worlds.step(scores)
        over = terminated | truncated
        for world in np.flatnonzero(over & ~ended):
            found[world] = info["outcome"]["detection_distance_m"][world] or 0.0
        ended |= over
        if over.any():
            observation, _ = worlds.reset(options={"reset_mask": over})
    worlds.close()
    return float(np.nan_to_num(found).mean())


def main(steps: int = STEPS, rate: float = RATE) -> tuple[float, float]:
    """Train; the distances before and after, which are printed too."""
    torch.set_num_threads(1)
    model = make_model(rate)
    before = distance_m(model)
    model.learn(steps)
    after = distance_m(model)
    print(f"first detection at {before:.1f} m untrained, at {after:.1f} m after {steps:,} steps")
    return before, after


if __name__ == "__main__":
    main()
