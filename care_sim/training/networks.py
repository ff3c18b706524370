"""The score map in PyTorch, as a policy of Stable-Baselines3.

`care_sim.policies.learned.ppo` computes the same network in NumPy.

It can be trained without a part, to measure that part's worth:

| without | removed part |
|---|---|
| `pictures` | all six pictures: the car's motion, the budget and the place remain |
| `place` | each sector's own number: only inputs decide its score |
| `tracks` | forecasts in the pictures; the allocator still fires at their hulls |
| `faults` | camera faults in the training episodes; validation episodes keep them |

A matrix before the first layer removes pictures. It is multiplied into the stored weights, which
therefore act in NumPy like any others. Tracks are in four pictures. `forecast` and `undetected`
vanish, and `residual` and `explained`, which differ by forecasts, become one. `fired` and
`nearness` stay: they show the last scan, including hulls at which the allocator fired.
"""

from collections.abc import Collection
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from care_sim.base.array_files import Arrays
from care_sim.policies.learned.grid_features import CHANNELS, EGO_INPUTS
from care_sim.policies.learned.ppo import BLOCK_MARGIN


def mixing(without: Collection[str]) -> NDArray[np.float32]:
    """Return (channels, channels) the matrix from pictures to inputs; the unit matrix if no picture
    is left out.
    """
    matrix = np.eye(len(CHANNELS), dtype=np.float32)
    if "tracks" in without:
        forecast, residual, explained, undetected = (
            CHANNELS.index(name) for name in ("forecast", "residual", "explained", "undetected")
        )
        matrix[[forecast, undetected, explained]] = 0
        matrix[residual, explained] = 1
    return matrix * ("pictures" not in without)


class Window(nn.Module):
    """Layer from each sector's inputs (its blocks, one more on each side, and the car's motion) to
    (n, hidden, sectors). `care_sim.policies.learned.ppo` computes the same in NumPy.

    `shape` is (channels, rows, columns) of the blocks, `sectors` (elevations, azimuths).
    `goes_round` is True for a full turn. `without` lists the omitted parts of the pictures
    (`care_sim.training.networks`).
    """

    mixing: Tensor

    def __init__(
        self,
        shape: tuple[int, int, int],
        sectors: tuple[int, int],
        hidden: int,
        goes_round: bool = True,
        without: Collection[str] = (),
    ):
        super().__init__()
        self.shape = shape
        self.goes_round = goes_round
        # Not kept in checkpoints, which hold only learned numbers.
        self.register_buffer("mixing", torch.from_numpy(mixing(without)), persistent=False)
        self._mixes = bool(without)
        stride = shape[1] // sectors[0], shape[2] // sectors[1]
        self.window = nn.Conv2d(
            shape[0], hidden, (stride[0] + 2 * BLOCK_MARGIN, stride[1] + 2 * BLOCK_MARGIN), stride
        )
        self.ego = nn.Linear(len(EGO_INPUTS), hidden, bias=False)
        self.hidden = nn.Conv2d(hidden, hidden, 1)

    def bordered(self, grid: Tensor) -> Tensor:
        """Return (n, channels, rows + 2, columns + 2) the blocks of grid (n, channels * rows *
        columns), with one more on each side.
        """
        channels, rows, columns = self.shape
        blocks = grid.view(-1, *self.shape)
        if self._mixes:
            blocks = torch.einsum("km,nmrc->nkrc", self.mixing, blocks)
        side = BLOCK_MARGIN
        result = blocks.new_zeros((len(blocks), channels, rows + 2 * side, columns + 2 * side))
        within = result[:, :, side:-side]
        within[..., side:-side] = blocks
        # On a full turn the columns continue over the seam; beyond the grid everything is 0.
        if self.goes_round:
            within[..., :side], within[..., -side:] = blocks[..., -side:], blocks[..., :side]
        return result

    def forward(self, ego: Tensor, blocks: Tensor) -> Tensor:
        """From ego (n, 4) and `bordered` blocks."""
        seen = self.window(blocks) + self.ego(ego)[:, :, None, None]
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
        without: Collection[str] = (),
    ):
        super().__init__()
        self.actor = Window(shape, sectors, hidden, goes_round, without)
        self.critic = Window(shape, sectors, hidden, goes_round, without)
        self.valued = nn.Sequential(nn.Linear(2 * hidden + len(EGO_INPUTS), 2 * hidden), nn.ReLU())
        self.latent_dim_pi = hidden
        self.latent_dim_vf = 2 * hidden

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Return the features of the actor and of the critic."""
        # Both read the same blocks, with the same border.
        ego, blocks = self._seen(features)
        return self.actor(ego, blocks), self._valued(ego, blocks)

    def forward_actor(self, features: Tensor) -> Tensor:
        """(n, hidden, sectors)."""
        result: Tensor = self.actor(*self._seen(features))
        return result

    def forward_critic(self, features: Tensor) -> Tensor:
        """(n, 2 * hidden)."""
        return self._valued(*self._seen(features))

    def _seen(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """The car's motion (n, 4) and the `bordered` blocks."""
        inputs = len(EGO_INPUTS)
        return features[:, :inputs], self.actor.bordered(features[:, inputs:])

    def _valued(self, ego: Tensor, blocks: Tensor) -> Tensor:
        seen = self.critic(ego, blocks)
        result: Tensor = self.valued(torch.cat([seen.mean(2), seen.amax(2), ego], 1))
        return result


class ScoreHead(nn.Module):
    """Layer to scores (n, sectors) from -1 to 1: one weight per feature, one number per sector."""

    def __init__(self, hidden: int, sectors: int):
        super().__init__()
        # Small first scores: the exploration then decides, and tanh is far from saturation.
        self.weight = nn.Parameter(0.1 * torch.randn(hidden))
        self.place = nn.Parameter(torch.zeros(sectors))

    def forward(self, seen: Tensor) -> Tensor:
        """From (n, hidden, sectors)."""
        return torch.tanh(torch.einsum("nhs,h->ns", seen, self.weight) + self.place)


class Joined(BaseFeaturesExtractor):
    """Features (n, 4 + channels * rows * columns): the observation's vectors, concatenated."""

    def __init__(self, observation_space: spaces.Dict):
        super().__init__(
            observation_space,
            sum(int(np.prod(space.shape or ())) for space in observation_space.values()),
        )

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """The car's motion first, as `Windows` expects."""
        return torch.cat([observation["ego"], observation["grid"]], 1)


class Sectored(BaseFeaturesExtractor):
    """Features (n, 4 + 4 * sectors): four per sector, and the car's motion. For learners with their
    own layers.
    """

    def __init__(
        self,
        observation_space: spaces.Dict,
        shape: tuple[int, int, int],
        sectors: tuple[int, int],
        goes_round: bool = True,
        without: Collection[str] = (),
    ):
        super().__init__(observation_space, len(EGO_INPUTS) + 4 * sectors[0] * sectors[1])
        self.window = Window(shape, sectors, 4, goes_round, without)

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        """The car's motion, then four features per sector."""
        ego, grid = observation["ego"], observation["grid"]
        return torch.cat([ego, self.window(ego, self.window.bordered(grid)).flatten(1)], 1)


class SectorPolicy(ActorCriticPolicy):
    """The score map as actor; `shape`, `goes_round` and `without` as of `Window`, `hidden` its
    width.
    """

    def __init__(
        self,
        *args: Any,
        shape: tuple[int, int, int],
        hidden: int = 16,
        goes_round: bool = True,
        without: Collection[str] = (),
        **kwargs: Any,
    ):
        self._without = without
        self._shape = shape
        self._hidden = hidden
        self._goes_round = goes_round
        super().__init__(*args, **kwargs | {"features_extractor_class": Joined})

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor: Any = Windows(
            self._shape, self._sectors, self._hidden, self._goes_round, self._without
        )

    def _build(self, lr_schedule: Any) -> None:
        super()._build(lr_schedule)
        # The head that Stable-Baselines3 made mixes sectors. The optimizer that it made holds that
        # head's parameters, so it is made anew too.
        self.action_net: Any = ScoreHead(self._hidden, int(np.prod(self._sectors)))
        # A parameter, since earlier checkpoints hold it; it stays 0.
        self.action_net.place.requires_grad_("place" not in self._without)
        self.optimizer = self.optimizer_class(
            self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs
        )  # type: ignore[call-arg]

    @property
    def _sectors(self) -> tuple[int, int]:
        elevations, azimuths = self.action_space.shape or ()
        return elevations, azimuths

    def arrays(self) -> Arrays:
        """The actor's weights by the names of `care_sim.policies.learned.ppo`."""
        named = {**self.mlp_extractor.actor.state_dict(), **self.action_net.state_dict()}
        arrays: Arrays = {name: tensor.cpu().numpy().copy() for name, tensor in named.items()}
        # The head calls its parameter `weight` alone.
        arrays["score.weight"] = arrays.pop("weight")
        # The 1 x 1 convolution is a matrix, and its kernel axes are dropped.
        arrays["hidden.weight"] = arrays["hidden.weight"][:, :, 0, 0]
        arrays["place"] = arrays["place"].reshape(self._sectors)
        if self._without:
            mixed = np.einsum("hkrc,km->hmrc", arrays["window.weight"], mixing(self._without))
            arrays["window.weight"] = np.ascontiguousarray(mixed, np.float32)
        return arrays
