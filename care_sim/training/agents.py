"""Trained agents: shipped ones, and those in folders and files."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from care_sim.base.checks import check_path, is_number
from care_sim.base.errors import InvalidInput, counted, shown
from care_sim.policies import BUILT_IN
from care_sim.policies.learned.weights import Card, load_weights, shipped_weights
from care_sim.study.rows.parameters import Parameters
from care_sim.training.config import AgentConfig, arguments_of
from care_sim.training.folder import CONFIG, WEIGHTS, read_config

_PACKAGE = Path(__file__).parents[1]
_SECONDS = re.compile(r", (\d+) s$")
"""Suffix of a card's machine with the time of learning."""


@dataclass(frozen=True)
class Agent:
    """A learned policy: its name, its file of weights (None for the policy's default), the first
    environment of its training, and that environment's parameters.
    """

    policy: str
    path: Path | None
    env: str
    budget: float
    env_parameters: Parameters = ()

    @classmethod
    def of_run(cls, config: AgentConfig, weights: Path) -> "Agent":
        """Return the agent that a run has trained."""
        env = config.env[0]
        given = tuple(config.arguments(env).items())
        return cls(config.algorithm, weights, env, config.budget[0], given)

    @classmethod
    def of_card(cls, policy: str, path: Path | None, card: Card) -> "Agent":
        """Return the agent that a card describes. Raises InvalidInput for a card without an
        environment.
        """
        if card.scenario is None:
            raise InvalidInput(f"weights {path}: the card names no environment")
        # A card of one budget holds its cells; cards that fit any budget take the user's.
        cells = card.budget / card.grid.size if card.budget is not None else _ANY_BUDGET
        budgets = [one for one in _listed(card, "budget") if is_number(one)]
        # The first of several environments; a parameter may belong to one of them.
        env = card.scenario.partition(" ")[0].rstrip(",")
        try:
            texts = [one for one in _listed(card, "env_parameters") if _is_text(one)]
            given = tuple(arguments_of(texts, env).items())
        except InvalidInput as error:
            raise InvalidInput(f"weights {path}: of its card, {error}") from error
        return cls(policy, path, env, next(iter(budgets), cells), given)


_ANY_BUDGET = 0.1
"""Default environment, as in `care-sim run`."""


def find_agent(named: str) -> Agent:
    """Return the agent of a name, a file, or a folder of `care-sim train`. Raises InvalidInput if
    there is none that can act outside its training, and for a damaged file.
    """
    for agent in shipped_agents():
        if named in (agent.name, agent.policy):
            return Agent.of_card(agent.policy, None, agent.card)
    check_path("agent", named)
    path = Path(named)
    if path.is_dir():
        path = _weights_in(path)
    if not path.is_file():
        known = ", ".join(sorted({agent.policy for agent in shipped_agents()}))
        raise InvalidInput(
            f"unknown agent {shown(named)}; known: {known}, or a folder or weights file of "
            "`care-sim train`"
        )
    card = load_weights(path).card
    return Agent.of_card(card.kind, path, card)


def _weights_in(folder: Path) -> Path:
    weights = folder / WEIGHTS
    if weights.is_file():
        return weights
    if not (folder / CONFIG).is_file():
        raise InvalidInput(f"{folder} holds no agent: no {WEIGHTS}")
    algorithm = read_config(folder / CONFIG)["algorithm"]
    raise InvalidInput(
        f"{folder} holds no {WEIGHTS}: "
        + (
            "its training was not evaluated yet"
            if algorithm == "ppo"
            else f"an agent of {algorithm} acts from its checkpoint alone, of ppo from its weights"
        )
    )


@dataclass(frozen=True)
class ShippedAgent:
    """A shipped agent: `name` of its file, the policy that acts with it, and its card."""

    name: str
    policy: str
    card: Card

    @property
    def columns(self) -> dict[str, str]:
        """Return the readable content of its card; empty for an empty card."""
        card, config = self.card, _config(self.card)
        seconds = _SECONDS.search(card.machine)
        seed = card.seeds.get("learner", card.seeds.get("training"))
        lies = shipped_weights(self.name).relative_to(_PACKAGE.parent)
        return {
            "policy": self.policy,
            "environment": card.scenario or "",
            "algorithm": str(config.get("algorithm", card.kind)),
            "budgets": ", ".join(map(str, _listed(card, "budget"))) or _budget(card),
            "steps": f"{card.steps:,}" if card.steps else "",
            "seed": "" if seed is None else str(seed),
            "wall time": f"{round(int(seconds[1]) / 60)} min" if seconds else "",
            "validation": _validation(card.result),
            "file": str(lies),
        }


def shipped_agents() -> list[ShippedAgent]:
    """Return the agents that come with the package, by name."""
    # Weights have the name of their policy, unless the policy declares another name.
    acting = {getattr(made, "weights", name): name for name, made in BUILT_IN.items()}
    files = sorted(shipped_weights("").parent.glob("*.npz"))
    return [
        ShippedAgent(file.stem, acting[file.stem], load_weights(file).card)
        for file in files
        if file.stem in acting
    ]


def agent_names() -> list[str]:
    """The names of agents that come with the package."""
    return [agent.name for agent in shipped_agents()]


def agent_lines() -> Iterator[str]:
    """The policy of every shipped agent, and below it what its card says."""
    for agent in shipped_agents():
        policy, *told = agent.columns.items()
        yield policy[1]
        yield from (f"    {name}: {value}" for name, value in told if value)


def _budget(card: Card) -> str:
    return "any" if card.budget is None else f"{card.budget / card.grid.size:.4g}"


def _validation(result: Mapping[str, Any]) -> str:
    """Return the validation figure that selected the weights; empty without one."""
    scored = result.get("validation")
    if isinstance(scored, dict):
        return f"return {scored['mean_return']:.2f}, {counted(scored['episodes'], 'episode')}"
    held_out = [f"{name} {loss:.3f}" for name, loss in result.items() if "held out" in name]
    return ", ".join(held_out)


def _config(card: Card) -> dict[str, Any]:
    """Return the run's configuration in a card; empty without one."""
    config = card.result.get("config")
    return config if isinstance(config, dict) else {}


def _listed(card: Card, name: str) -> list[Any]:
    """Return a list of the configuration; empty without one."""
    told = _config(card).get(name)
    return told if isinstance(told, list) else []


def _is_text(value: object) -> bool:
    return isinstance(value, str)
