"""The observations, actions and fired cells of a policy over the first keyframes of an episode."""


def played(env, policy, keyframes):
    """The observation, the action and the fired cells of each keyframe, of seed 0."""
    observation, _ = env.reset(seed=0)
    policy.reset()
    for _ in range(keyframes):
        action = policy(observation)
        observation, _, _, _, info = env.step(action)
        yield observation, action, info["fired"]
