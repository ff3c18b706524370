"""What a policy saw, asked for and fired over the first keyframes of an episode."""


def played(env, policy, keyframes):
    """Of each keyframe the observation, the action and the fired cells, of seed 0."""
    observation, _ = env.reset(seed=0)
    policy.reset()
    for _ in range(keyframes):
        action = policy(observation)
        observation, _, _, _, info = env.step(action)
        yield observation, action, info["fired"]
