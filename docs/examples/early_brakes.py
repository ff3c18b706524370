"""Does the car brake for somebody, or before there is anybody? In the paper's scenes, by detector.

    python docs/examples/early_brakes.py

`care` at 10% of the cells, seeds 0 to 4. The detector `pillars` needs the extra `rl`.
"""

import gymnasium as gym

import care_sim

SCENES = ("CARE-Dartout-v0", "CARE-Dense-v0", "CARE-CutIn-v0")
DETECTORS = ("returns", "pillars")
SEEDS = range(5)


def early_s(env_id: str, detector: str, seed: int) -> float:
    """How long before the first-sighting actor is in view the car first brakes, seconds; below 0
    afterwards.
    """
    env = gym.make(env_id, budget=0.10, detector=detector)
    policy = care_sim.make_policy("care", env)
    observation, _ = env.reset(seed=seed)
    policy.reset()
    begun: dict[str, float] = {}
    done = False
    while not done:
        observation, _, terminated, truncated, info = env.step(policy(observation))
        done = terminated or truncated
        for event in ("braking", "in_view"):
            if info[event]:
                begun.setdefault(event, info["time_s"])
    env.close()
    return begun["in_view"] - begun["braking"]


def main() -> None:
    """Print how many brake early, and by how much."""
    for detector in DETECTORS:
        for env_id in SCENES:
            early = [early_s(env_id, detector, seed) for seed in SEEDS]
            count = sum(seconds > 0 for seconds in early)
            print(
                f"{detector}, {env_id}: {count} of {len(early)} before anybody is in view, "
                f"by {min(early):.1f} to {max(early):.1f} s"
            )


if __name__ == "__main__":
    main()
