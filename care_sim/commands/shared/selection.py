"""Resolve names on a command line: scenarios, policies, sources, values of a condition."""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from care_sim.base.errors import (
    BrokenPolicy,
    BrokenScenario,
    InvalidInput,
    MissingExtra,
    report_problems,
)
from care_sim.base.plugins import scenario_of
from care_sim.commands.options.shared import (
    DetectorOptions,
    EpisodeOptions,
    PlayOptions,
    SourceOptions,
)
from care_sim.core.conditions import DEFAULTS
from care_sim.policies import check_policy, contenders
from care_sim.scenarios import PLUGINS, SCENARIOS, make_scenario, scenario_names
from care_sim.study.rows.parameters import Parameters, parameters
from care_sim.study.run_config import RunConfig

if TYPE_CHECKING:
    from care_sim.sources.scenes import Source

_ALL = "all"
"""The name that stands for every known one."""


def expanded(names: Sequence[str], known: Collection[str]) -> list[str]:
    """The names, each once; `all` stands for those that are known."""
    return list(
        dict.fromkeys(each for name in names for each in (known if name == _ALL else [name]))
    )


def check_values(command: object, *axes: str) -> None:
    """Raise InvalidInput where an option of the command that takes several values has none."""
    for axis in axes:
        if not getattr(command, axis):
            raise InvalidInput(f"--{axis.replace('_', '-')} needs at least one value")


def buildable(names: Sequence[str], given: Parameters) -> tuple[list[str], list[str]]:
    """Return the scenarios whose worlds can be built with the `given` parameters. Each comes once;
    `all` stands for every known one. Also returns, and prints, a line for each scenario that cannot
    be built. Raises InvalidInput for an unknown scenario or parameter, and where none is left.
    """
    wanted = expanded(names, scenario_names())
    report_problems([line for one, line in PLUGINS.refusals() if scenario_of(one.name) in wanted])
    return _sound("scenarios", wanted, lambda name: check_built(name, given), BrokenScenario, 1)


def check_built(scenario: str, given: Parameters) -> None:
    """Build a world of a scenario that is not built in, which nobody has tried. Raises what that
    raises.
    """
    made = make_scenario(scenario, **dict(given))
    if scenario not in SCENARIOS:
        made.make_world(np.random.default_rng(0)).close()


def playable(
    names: Sequence[str], make: Callable[[str], Iterable[RunConfig]], least: int = 1
) -> tuple[list[str], list[str]]:
    """The policies, each once, that can begin the tasks that `make` makes, and a line for each of
    the others, which is printed too.

    Raises InvalidInput where something else is wrong, and if fewer than `least` policies are left.
    """

    def try_out(name: str) -> None:
        for config in make(name):
            config.try_out()

    return _sound("policies", _policies(names), try_out, BrokenPolicy, least)


def _sound(
    kind: str,
    names: Sequence[str],
    make: Callable[[str], object],
    broken: type[Exception],
    least: int,
) -> tuple[list[str], list[str]]:
    sound, left_out = [], []
    for name in names:
        try:
            make(name)
            sound.append(name)
        except (broken, MissingExtra) as error:
            left_out.append(f"left out: {error}")
    report_problems(left_out)
    if len(sound) < least:
        raise InvalidInput(f"none of the {kind} can be played")
    return sound, left_out


def policy_parameters(texts: Sequence[str], policies: Sequence[str]) -> Parameters:
    """The parameters that are given as NAME=VALUE or POLICY.NAME=VALUE to the named `policies`.

    Raises InvalidInput for one of a policy that is not among them: it would change nothing.
    """
    given = parameters(texts)
    played = _policies(policies)
    for name, _ in given:
        owner = name.rpartition(".")[0]
        if owner and owner not in played:
            check_policy(owner)
            raise InvalidInput(
                f"policy parameter {name} is of a policy that is not played; played are "
                f"{', '.join(played)}"
            )
    return given


def _policies(names: Sequence[str]) -> list[str]:
    return expanded(names, contenders() if _ALL in names else ())


def take_values(several: Sequence[Any], name: str, common: dict[str, Any]) -> Sequence[Any]:
    """The values of a condition that a sweep plays in turn: `several`, or else the one in `common`,
    which loses it.
    """
    one = common.pop(name)
    if several and one != DEFAULTS[name]:
        raise InvalidInput(f"give {name} one value or several, not both")
    return several or (one,)


def arguments_of(options: EpisodeOptions, policies: Sequence[str]) -> dict[str, Any]:
    """As arguments of `EpisodeConfig`, for studies that play these policies. Raises InvalidInput
    for parameters of another policy.
    """
    return options.sensing() | {
        "scenario_parameters": parameters(options.scenario_parameters),
        "policy_parameters": policy_parameters(options.policy_parameters, policies),
    }


def common_of(options: PlayOptions, policies: Sequence[str]) -> dict[str, Any]:
    """Conditions and parameters that all plays share, as fields of
    `care_sim.study.play_config.PlayConfig`, for studies that play these policies. Raises
    InvalidInput for parameters of another policy.
    """
    return asdict(options.conditions) | {
        "detector": options.detector,
        "detector_parameters": parameters(options.detector_parameters),
        "policy_parameters": policy_parameters(options.policy_parameters, policies),
    }


def source_named(options: SourceOptions, text: str) -> "Source":
    """Return the source that a text and the options name. Without --sweeps a detector gets its own
    number of sweeps. Raises InvalidInput if there is no such source.
    """
    # Imported here because the kinds of recordings load SciPy and PyArrow.
    from care_sim.sources.feeding import source_for
    from care_sim.sources.installed import SOURCES
    from care_sim.sources.named import source_of

    # If two sources have one name, a line says which plays.
    kind = text.partition(":")[0]
    report_problems([line for one, line in SOURCES.refusals() if one.name == kind])
    given = {name: getattr(options, name) for name in options.source_options()}
    source = source_of(text, **given)
    if not isinstance(options, DetectorOptions):
        return source
    own = parameters(options.detector_parameters)
    return source_for(source, options.detector, own, options.sweeps)


def named_after(command: str, played: str) -> str:
    """The name of a folder: a command and the kind of source, or world, that it plays."""
    return f"{command}-{played.partition(':')[0]}"
