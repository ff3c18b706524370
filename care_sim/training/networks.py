"""The score map in PyTorch, as a policy of Stable-Baselines3.

`care_sim.policies.learned.score_map` computes the same network in NumPy.
"""

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn
from torch.nn.functional import pad

from care_sim.base.array_files import Arrays
from care_sim.policies.learned.grid_features import EGO_INPUTS
from care_sim.policies.learned.score_map import BLOCK_MARGIN


class Window(nn.Module):
    """(n, hidden, sectors) from what each sector sees: its blocks, one more on each side, and the
    car's motion. `care_sim.policies.learned.score_map` computes the same in NumPy.

    `shape` is (channels, rows, columns) of the blocks, `sectors` (elevations, azimuths);
    `goes_round` says whether the grid does.
    """

    def __init__(
        self,
        shape: tuple[int, int, int],
        sectors: tuple[int, int],
        hidden: int,
        goes_round: bool = True,
    ):
        super().__init__()
        self.shape = shape
        self.beside = "circular" if goes_round else "constant"
        stride = shape[1] // sectors[0], shape[2] // sectors[1]
        self.window = nn.Conv2d(
            shape[0], hidden, (stride[0] + 2 * BLOCK_MARGIN, stride[1] + 2 * BLOCK_MARGIN), stride
        )
        self.ego = nn.Linear(len(EGO_INPUTS), hidden, bias=False)
        self.hidden = nn.Conv2d(hidden, hidden, 1)

    def forward(self, ego: Tensor, grid: Tensor) -> Tensor:
        """From ego (n, 4) and grid (n, channels * rows * columns)."""
        # All round the car the columns go on over the seam; beyond the grid there is nothing.
        wrapped = pad(
            grid.view(-1, *self.shape), (BLOCK_MARGIN, BLOCK_MARGIN, 0, 0), mode=self.beside
        )
        seen = (
            self.window(pad(wrapped, (0, 0, BLOCK_MARGIN, BLOCK_MARGIN)))
            + self.ego(ego)[:, :, None, None]
        )
        return torch.relu(self.hidden(torch.relu(seen))).flatten(2)


class Windows(nn.Module):
    """One window for the actor, another for the critic.

    The critic's sectors are pooled into mean and maximum.
    """

    def __init__(
        self,
        shape: tuple[int, int, int],
        sectors: tuple[int, int],
        hidden: int,
        goes_round: bool = True,
    ):
        super().__init__()
        self.actor = Window(shape, sectors, hidden, goes_round)
        self.critic = Window(shape, sectors, hidden, goes_round)
        self.valued = nn.Sequential(nn.Linear(2 * hidden + len(EGO_INPUTS), 2 * hidden), nn.ReLU())
        self.latent_dim_pi = hidden
        self.latent_dim_vf = 2 * hidden

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """The features of the actor and those of the critic."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: Tensor) -> Tensor:
        """(n, hidden, sectors)."""
        result: Tensor = self.actor(*_parts(features))
        return result

    def forward_critic(self, features: Tensor) -> Tensor:
        """(n, 2 * hidden)."""
        ego, grid = _parts(features)
        seen = self.critic(ego, grid)
        result: Tensor = self.valued(torch.cat([seen.mean(2), seen.amax(2), ego], 1))
        return result


class ScoreHead(nn.Module):
    """(n, sectors) from -1 to 1: one weight per feature, one number per sector."""

    def __init__(self, hidden: int, sectors: int):
        super().__init__()
        # Small first scores: the exploration then decides, and tanh is far from saturation.
        self.weight = nn.Parameter(0.1 * torch.randn(hidden))
        self.place = nn.Parameter(torch.zeros(sectors))

    def forward(self, seen: Tensor) -> Tensor:
        """From (n, hidden, sectors)."""
        return torch.tanh(torch.einsum("nhs,h->ns", seen, self.weight) + self.place)


class Joined(BaseFeaturesExtractor):
    """(n, 4 + channels * rows * columns): the observation's vectors, one after the other."""

    def __init__(self, observation_space: spaces.Dict):
        super().__init__(
            observation_space,
            sum(int(np.prod(space.shape or ())) for space in observation_space.values()),
        )

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """The car's motion first, as `_parts` expects."""
        return torch.cat([observation["ego"], observation["grid"]], 1)


class Sectored(BaseFeaturesExtractor):
    """(n, 4 + 4 * sectors): four features per sector and the car's motion.

    For learners with layers of their own.
    """

    def __init__(
        self,
        observation_space: spaces.Dict,
        shape: tuple[int, int, int],
        sectors: tuple[int, int],
        goes_round: bool = True,
    ):
        super().__init__(observation_space, len(EGO_INPUTS) + 4 * sectors[0] * sectors[1])
        self.window = Window(shape, sectors, 4, goes_round)

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """The car's motion, then four features per sector."""
        ego, grid = observation["ego"], observation["grid"]
        return torch.cat([ego, self.window(ego, grid).flatten(1)], 1)


class SectorPolicy(ActorCriticPolicy):
    """The score map as actor; `shape` and `goes_round` as of `Window`, `hidden` its width."""

    def __init__(
        self,
        *args: Any,
        shape: tuple[int, int, int],
        hidden: int = 16,
        goes_round: bool = True,
        **kwargs: Any,
    ):
        self._shape = shape
        self._hidden = hidden
        self._goes_round = goes_round
        super().__init__(*args, **kwargs | {"features_extractor_class": Joined})

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor: Any = Windows(
            self._shape, self._sectors, self._hidden, self._goes_round
        )

    def _build(self, lr_schedule: Any) -> None:
        super()._build(lr_schedule)
        # The head that Stable-Baselines3 made mixes sectors. The optimizer that it made holds that
        # head's parameters, so it is made anew too.
        self.action_net: Any = ScoreHead(self._hidden, int(np.prod(self._sectors)))
        self.optimizer = self.optimizer_class(
            self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs
        )  # type: ignore[call-arg]

    @property
    def _sectors(self) -> tuple[int, int]:
        elevations, azimuths = self.action_space.shape or ()
        return elevations, azimuths

    def arrays(self) -> Arrays:
        """The actor's weights by the names of `care_sim.policies.learned.score_map`."""
        named = {**self.mlp_extractor.actor.state_dict(), **self.action_net.state_dict()}
        arrays: Arrays = {name: tensor.cpu().numpy().copy() for name, tensor in named.items()}
        # The head calls its parameter `weight` alone.
        arrays["score.weight"] = arrays.pop("weight")
        # The 1 x 1 convolution is a matrix, and its kernel axes are dropped.
        arrays["hidden.weight"] = arrays["hidden.weight"][:, :, 0, 0]
        arrays["place"] = arrays["place"].reshape(self._sectors)
        return arrays


def _parts(features: Tensor) -> tuple[Tensor, Tensor]:
    return features[:, : len(EGO_INPUTS)], features[:, len(EGO_INPUTS) :]
