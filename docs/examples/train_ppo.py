"""Proximal policy optimisation in one file: a learner that ranks sectors for the LiDAR's reserve.

    python docs/examples/train_ppo.py        # about five minutes on one core; needs the extra rl,
    for PyTorch

Everything is here but the environment: the network, the rollout, the advantages, the update.
`care-sim train ppo` does the same with Stable-Baselines3, keeps checkpoints, and makes the weights
a policy of the benchmark.
"""

import gymnasium as gym
import numpy as np
import torch
from torch import nn
from torch.distributions import Normal
from torch.nn.functional import pad

import care_sim  # noqa: F401 (registers the environments)
from care_sim.wrappers import VectorGridObservation, VectorSectorReserve

ENVIRONMENTS, ROLLOUT, UPDATES = 8, 128, 50
EPOCHS, BATCH, CLIP = 4, 256, 0.2
DISCOUNT, TRACE, RATE = 0.9, 0.9, 1e-3
CHANNELS, ROWS, COLUMNS, HIDDEN = 6, 8, 64, 16
TRAINING_SEEDS = 10_000  # lower ones are for tests


class Sectors(nn.Module):
    """One small network slides over the 4 x 32 sectors: 2 x 2 blocks each, and one more on every
    side.
    """

    def __init__(self) -> None:
        super().__init__()
        self.look = nn.Conv2d(CHANNELS, HIDDEN, kernel_size=4, stride=2)
        self.feel = nn.Linear(4, HIDDEN)
        self.think = nn.Conv2d(HIDDEN, HIDDEN, kernel_size=1)

    def forward(self, grid: torch.Tensor, ego: torch.Tensor) -> torch.Tensor:
        """(n, HIDDEN, 4, 32); the grid goes on behind the car."""
        picture = pad(grid.view(-1, CHANNELS, ROWS, COLUMNS), (1, 1, 0, 0), mode="circular")
        seen = self.look(pad(picture, (0, 0, 1, 1))) + self.feel(ego)[:, :, None, None]
        return torch.relu(self.think(torch.relu(seen)))


class Agent(nn.Module):
    """Scores of sectors with noise, and the value of what is seen."""

    def __init__(self) -> None:
        super().__init__()
        self.actor, self.critic = Sectors(), Sectors()
        self.score = nn.Conv2d(HIDDEN, 1, kernel_size=1)
        self.worth = nn.Sequential(nn.Linear(2 * HIDDEN + 4, 32), nn.ReLU(), nn.Linear(32, 1))
        self.log_noise = nn.Parameter(torch.full((4, 32), np.log(0.3)))

    def forward(self, grid: torch.Tensor, ego: torch.Tensor) -> tuple[Normal, torch.Tensor]:
        """A distribution over scores (n, 4, 32), and values (n,)."""
        scores = torch.tanh(self.score(self.actor(grid, ego)).squeeze(1))
        seen = self.critic(grid, ego).flatten(2)
        pooled = torch.cat([seen.mean(2), seen.amax(2), ego], dim=1)
        return Normal(scores, self.log_noise.exp()), self.worth(pooled).squeeze(1)


def make_envs() -> gym.vector.VectorEnv:
    """Dense streets at 3% of the cells, rewarded for detecting as early as a full scan would."""
    envs = gym.make_vec(
        "CARE-Dense-v0",
        num_envs=ENVIRONMENTS,
        autoreset_mode="SameStep",
        budget=0.03,
        reward_weights={"gain": 10.0},
    )
    pictured = VectorGridObservation(VectorSectorReserve(envs))
    return gym.wrappers.vector.RecordEpisodeStatistics(pictured)


def tensors(observation: dict[str, np.ndarray]) -> tuple[torch.Tensor, torch.Tensor]:
    """Grid and ego."""
    return torch.as_tensor(observation["grid"]), torch.as_tensor(observation["ego"])


def advantages(rewards: torch.Tensor, values: torch.Tensor, ends: torch.Tensor) -> torch.Tensor:
    """Generalised advantages (ROLLOUT, ENVIRONMENTS); `values` has one row more, an end cuts the
    trace.
    """
    result, trace = torch.zeros_like(rewards), torch.zeros(ENVIRONMENTS)
    for t in reversed(range(ROLLOUT)):
        surprise = rewards[t] + DISCOUNT * values[t + 1] * (1 - ends[t]) - values[t]
        result[t] = trace = surprise + DISCOUNT * TRACE * (1 - ends[t]) * trace
    return result


def loss_of(agent: Agent, batch: list[torch.Tensor]) -> torch.Tensor:
    """The clipped surrogate and half the squared error of the values (Schulman et al. 2017)."""
    grid, ego, action, before, advantage, target = batch
    chance, value = agent(grid, ego)
    ratio = (chance.log_prob(action).sum((1, 2)) - before).exp()
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    gained = torch.min(ratio * advantage, ratio.clamp(1 - CLIP, 1 + CLIP) * advantage)
    return 0.5 * (value - target).pow(2).mean() - gained.mean()


def main() -> None:
    """Train, and print the mean return of the episodes that end in every update."""
    torch.manual_seed(0)
    torch.set_num_threads(1)
    agent = Agent()
    optimiser = torch.optim.Adam(agent.parameters(), lr=RATE)
    envs = make_envs()
    observation, _ = envs.reset(seed=TRAINING_SEEDS)
    for update in range(UPDATES):
        steps, returns = [], []
        for _ in range(ROLLOUT):
            grid, ego = tensors(observation)
            with torch.no_grad():
                chance, value = agent(grid, ego)
            action = chance.sample()
            observation, reward, terminated, truncated, info = envs.step(
                action.clamp(-1, 1).numpy()
            )
            end = torch.as_tensor(terminated | truncated, dtype=torch.float32)
            before = chance.log_prob(action).sum((1, 2))
            steps.append(
                (
                    grid,
                    ego,
                    action,
                    before,
                    torch.as_tensor(reward, dtype=torch.float32),
                    end,
                    value,
                )
            )
            if "episode" in info:
                returns += info["episode"]["r"][info["_episode"]].tolist()
        grid, ego, action, before, rewards, ends, values = (
            torch.stack(column) for column in zip(*steps, strict=True)
        )
        with torch.no_grad():
            last = agent(*tensors(observation))[1]
        advantage = advantages(rewards, torch.cat([values, last[None]]), ends)
        rows = [
            part.flatten(0, 1)
            for part in (grid, ego, action, before, advantage, advantage + values)
        ]
        for _ in range(EPOCHS):
            for chosen in torch.randperm(ROLLOUT * ENVIRONMENTS).split(BATCH):
                loss = loss_of(agent, [row[chosen] for row in rows])
                optimiser.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
                optimiser.step()
        print(
            f"{(update + 1) * ROLLOUT * ENVIRONMENTS:6} steps: return {np.mean(returns):7.2f}",
            flush=True,
        )
    envs.close()


if __name__ == "__main__":
    main()
