"""How a trained agent is played where it learned: its world and conditions as options of commands,
and the lines of commands that play it.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from typing import Any

from care_sim.base.scenario_names import scenario_of
from care_sim.commands.options.shared import EpisodeOptions
from care_sim.commands.options.studies import Protocol, Sweep
from care_sim.commands.shared.command_line import command_line
from care_sim.core.conditions import ClosedLoopConditions, Conditions
from care_sim.envs import OPEN_LOOP
from care_sim.training.agents import Agent

_STREET, _REPLAY = OPEN_LOOP
_CONDITIONS = {one.name for one in fields(ClosedLoopConditions)}
_OPTIONS = {*_CONDITIONS, "sensor", "detector"}
"""Parameters of environments that are options of commands, in the same form."""
_USUAL = asdict(ClosedLoopConditions())
_OF_REPLAY = ("source", "scene", "split", "version")
"""Parameters that say which scene is played."""
_NO_OPTION = (
    "detector_parameters",
    "keyframe_s",
    "presence",
    "render_mode",
    "scoring_info",
    "secret",
)
"""Parameters that no command which plays one episode takes."""


@dataclass(frozen=True)
class AgentPlay:
    """An agent and how it is played."""

    agent: Agent

    @cached_property
    def _given(self) -> dict[str, Any]:
        return dict(self.agent.env_parameters)

    @property
    def is_open(self) -> bool:
        """Whether it learned in the open loop."""
        return self.agent.env in OPEN_LOOP

    @property
    def world(self) -> str:
        """The scenario, or the source of scenes, as `care-sim run` names it."""
        if self.agent.env == _STREET:
            return "street"
        if self.agent.env == _REPLAY:
            return str(self._given.get("source", ""))
        return scenario_of(self.agent.env)

    @property
    def scene(self) -> dict[str, Any]:
        """Which scene of the source it learned in, as options of `care-sim run`."""
        names = _OF_REPLAY[1:] if self.agent.env == _REPLAY else ()
        return {name: self._given[name] for name in names if name in self._given}

    def options(self, given: EpisodeOptions, only_agent: bool = False) -> dict[str, Any]:
        """The options of episodes with the weights, and with the conditions and the physics that
        the agent learned with where `given` has the default; with `only_agent` with the weights
        alone.
        """
        # `path=` is before what is given, over which the same name would be one too many.
        path = [] if self.agent.path is None else [f"path={self.agent.path}"]
        told = _shared(given) | {"policy_parameters": (*path, *given.policy_parameters)}
        if only_agent:
            return told
        conditions = {
            name: value
            for name, value in self._given.items()
            if name in _CONDITIONS and getattr(given.conditions, name) == _USUAL[name]
        }
        told["conditions"] = replace(given.conditions, **conditions)
        for name in ("sensor", "detector"):
            if name in self._given and told[name] == getattr(EpisodeOptions, name):
                told[name] = self._given[name]
        own = {text.partition("=")[0] for text in given.scenario_parameters}
        physics = [
            f"{name}={_written(value)}" for name, value in self._physics() if name not in own
        ]
        return told | {"scenario_parameters": (*physics, *given.scenario_parameters)}

    def left_out(self) -> list[str]:
        """The parameters that no command has."""
        return [name for name in _NO_OPTION if name in self._given]

    def _physics(self) -> Iterator[tuple[str, Any]]:
        for name, value in self._given.items():
            known = name in _OPTIONS or name in _NO_OPTION
            if not (known or self.is_open):
                yield name, value

    def study_line(self) -> str:
        """The command that plays the agent beside `care` where it learned."""
        given = self.options(EpisodeOptions())
        policies = ("care", self.agent.policy)
        path = tuple(f"{self.agent.policy}.{one}" for one in given["policy_parameters"])
        given = given | {"policy_parameters": path}
        if not self.is_open:
            budgets = (self.agent.budget,)
            return command_line(
                Sweep(scenarios=(self.world,), policies=policies, budgets=budgets, **given)
            )
        conditions = {
            one.name: getattr(given["conditions"], one.name) for one in fields(Conditions)
        }
        return command_line(
            Protocol(
                source="streets" if self.agent.env == _STREET else self.world,
                split=self.scene.get("split"),
                version=self.scene.get("version"),
                detector=given["detector"],
                policies=policies,
                policy_parameters=path,
                budgets=(self.agent.budget,),
                conditions=Conditions(**conditions),
            )
        )


def _shared(given: EpisodeOptions) -> dict[str, Any]:
    """The options of episodes, of a command that has more."""
    return {one.name: getattr(given, one.name) for one in fields(EpisodeOptions)}


def _written(value: Any) -> str:
    """A value as NAME=VALUE has it."""
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
