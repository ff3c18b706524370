"""How a trained agent is played where it learned: its world and conditions as options of commands,
and the lines of commands that play it.
"""

from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from typing import Any

from care_sim.base.errors import InvalidInput
from care_sim.base.plugins import scenario_of
from care_sim.commands.options.shared import EpisodeOptions
from care_sim.commands.options.studies import Protocol, Sweep
from care_sim.commands.shared.command_line import command_line
from care_sim.core.conditions import ClosedLoopConditions, Conditions
from care_sim.envs import OPEN_LOOP
from care_sim.training.agents import Agent

_STREET, _REPLAY = OPEN_LOOP
_CONDITIONS = {one.name for one in fields(ClosedLoopConditions)}
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
_NO_PHYSICS = {*_CONDITIONS, "sensor", "detector", *_NO_OPTION}
"""Parameters of environments that are none of the scenario."""


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
            if "source" not in self._given:
                raise InvalidInput(
                    f"weights {self.agent.path} learned from recordings: name a source by "
                    "--scenario, such as nuscenes:FOLDER"
                )
            return str(self._given["source"])
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
        told = {one.name: getattr(given, one.name) for one in fields(EpisodeOptions)}
        # `path=` is before what is given, over which the same name would be one too many.
        path = [] if self.agent.path is None else [f"path={self.agent.path}"]
        told["policy_parameters"] = (*path, *given.policy_parameters)
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
        own = {text.partition("=")[0] for text in given.scenario_parameters} | _NO_PHYSICS
        physics = [
            f"{name}={_written(value)}"
            for name, value in self._given.items()
            if name not in own and not self.is_open
        ]
        return told | {"scenario_parameters": (*physics, *given.scenario_parameters)}

    def left_out(self) -> list[str]:
        """The parameters that no command has."""
        return [name for name in _NO_OPTION if name in self._given]

    def study_line(self) -> str:
        """The command that plays the agent beside `care` where it learned."""
        given = self.options(EpisodeOptions())
        path = tuple(f"{self.agent.policy}.{one}" for one in given["policy_parameters"])
        shared: dict[str, Any] = {
            "policies": ("care", self.agent.policy),
            "policy_parameters": path,
            "budgets": (self.agent.budget,),
        }
        if not self.is_open:
            return command_line(Sweep(scenarios=(self.world,), **given | shared))
        conditions = {
            one.name: getattr(given["conditions"], one.name) for one in fields(Conditions)
        }
        return command_line(
            Protocol(
                source="streets" if self.agent.env == _STREET else self.world,
                split=self.scene.get("split"),
                version=self.scene.get("version"),
                detector=given["detector"],
                conditions=Conditions(**conditions),
                **shared,
            )
        )


def _written(value: Any) -> str:
    """A value as NAME=VALUE has it."""
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
