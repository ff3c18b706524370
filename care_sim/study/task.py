"""What a study hands to its workers: a policy, and the world that it meets, named by a digest."""

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Hashable, Sequence
from copy import copy
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import Any, Self

import gymnasium
import numpy as np

import care_sim
from care_sim.conditions import DEFAULTS, UNFELT_BY_FULL
from care_sim.errors import LARGEST_SEED, InvalidInput, is_text, one_line, shown
from care_sim.policies import check_policy, make_policy
from care_sim.policies.base import Policy
from care_sim.study.provenance import SESSION, code_digest, file_digest, policy_digest

Parameters = tuple[tuple[str, Any], ...]
"""Names and values, of a scenario's physics, a policy or a detector."""

Row = dict[str, Any]

Likeness = tuple[object, ...]
"""What tasks have in common."""

CONDITIONS = [*DEFAULTS]
DEEPEST = 3
"""Lists within lists that a parameter may be."""
REFERENCE, FULL = "care", "full"
"""The policy that others are compared with, and the full scan."""


class Task(ABC):
    """Everything that decides a row of a study. Subclasses are frozen dataclasses."""

    policy: str
    budget: float
    policy_parameters: Parameters

    @abstractmethod
    def row(self) -> Row:
        """Every parameter flat; those that have parameters of their own as `WHAT.NAME`."""

    @property
    @abstractmethod
    def label(self) -> str:
        """A short name for people."""

    @property
    @abstractmethod
    def order(self) -> int:
        """Tasks with lower numbers are played first."""

    @property
    @abstractmethod
    def batch(self) -> Hashable:
        """Tasks with equal ones are handed to one worker together."""

    @property
    @abstractmethod
    def likenesses(self) -> tuple[Likeness, ...]:
        """What it shares with tasks that take as long, the closest likeness first."""

    def make_policy(self, env: gymnasium.Env[Any, Any]) -> Policy:
        """The policy for the environment."""
        return make_policy(self.policy, env, **dict(self.policy_parameters))

    def digest(self) -> str:
        """Hash of the effective configuration; package version, code and what is installed beside it included.

        It never repeats in another run when an installed policy has no source to read.
        """
        code = [code_digest(), *(self._session if digest is None else digest for digest in self.installed())]
        effective = [sorted(self.row().items()), care_sim.__version__, *code]
        return hashlib.sha256(json.dumps(effective).encode()).hexdigest()[:16]

    def installed(self) -> list[str | None]:
        """Hashes of what decides the row beside the package and the parameters: code of others, and the files that
        parameters name; None of code that has no source to read.
        """
        return [policy_digest(self.policy), *files_in(self.policy_parameters)]

    @cached_property
    def _session(self) -> str:
        """The run that first asked for the digest, which the workers keep."""
        return SESSION

    def changed(self, **values: object) -> Self:
        """The same with other values of fields that need no check."""
        other = copy(self)
        for name, value in values.items():
            object.__setattr__(other, name, value)
        return other

    def settle(self, *names: str) -> None:
        """Make the parameters of these names what files can hold."""
        for name in names:
            pairs = getattr(self, name)
            if not (isinstance(pairs, tuple | list) and all(map(_is_pair, pairs))):
                raise InvalidInput(f"{name} must be pairs of a name and a value, got {shown(pairs)}")
            object.__setattr__(self, name, tuple((key, _plain(key, value)) for key, value in pairs))


def departures(task: Task, without: Sequence[str]) -> list[str]:
    """What of a task's row departs from the default conditions, as NAME=VALUE."""
    return [f"{n}={v}" for n, v in task.row().items() if n not in without and v != DEFAULTS.get(n)]


def felt(policy: str, budget: float, conditions: dict[str, Any]) -> dict[str, Any]:
    """Budget and conditions as a policy feels them: the full scan has one budget, and asks neither camera nor
    allocator.
    """
    check_policy(policy)
    felt = conditions | {"budget": budget}
    if parameters := conditions.get("policy_parameters"):
        felt["policy_parameters"] = own(policy, parameters)
    if policy == FULL:
        felt |= {"budget": 1.0} | {name: DEFAULTS[name] for name in UNFELT_BY_FULL}
    return felt


def own(policy: str, parameters: Parameters) -> Parameters:
    """Those of a policy among parameters for several: NAME is for all, POLICY.NAME for that policy alone.

    Raises InvalidInput for a name before the point that is no policy.
    """
    parted = [(*name.rpartition("."), value) for name, value in parameters]
    for owner, point, _, _ in parted:
        if point:
            check_policy(owner)
    return tuple((name, value) for owner, point, name, value in parted if not point or owner == policy)


def files_in(parameters: Parameters) -> list[str]:
    """Hashes of the files and folders that parameters name."""
    paths = (Path(value) for _, value in parameters if isinstance(value, str))
    return [file_digest(path) for path in paths if path.exists()]


def flat(prefix: str, parameters: Parameters) -> Row:
    """Parameters as columns."""
    return {f"{prefix}.{name}": value for name, value in parameters}


def batches(tasks: Sequence[Task]) -> list[list[Task]]:
    """The tasks in the order in which they are played, those of a batch together."""
    together: dict[Hashable, list[Task]] = {}
    for task in sorted(tasks, key=lambda task: task.order):
        together.setdefault(task.batch, []).append(task)
    return list(together.values())


def collected(plain: Sequence[dict[str, Any]], axis: str, plural: str) -> list[dict[str, Any]]:
    """Configurations as plain data, each once, with the list of all values of an axis under its plural."""
    values: dict[str, list[Any]] = {}
    kept: dict[str, dict[str, Any]] = {}
    for one in plain:
        rest = {name: value for name, value in one.items() if name != axis}
        key = json.dumps(rest)
        kept[key] = rest
        values.setdefault(key, []).append(one[axis])
    return [{**rest, plural: values[key]} for key, rest in kept.items()]


def _is_pair(given: object) -> bool:
    return isinstance(given, tuple | list) and len(given) == 2 and isinstance(given[0], str)


def _plain(name: str, value: Any, depth: int = 0) -> Any:
    """A parameter's value as Python's own type, which files can hold. Raises InvalidInput for one that they cannot."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, tuple | list) and depth < DEEPEST:
        return tuple(_plain(name, one, depth + 1) for one in value)
    held = value is None or isinstance(value, bool) or (isinstance(value, str) and is_text(value))
    held = held or (type(value) is int and abs(value) <= LARGEST_SEED) or (type(value) is float and isfinite(value))
    if not held:
        raise InvalidInput(
            f"parameter {one_line(name)} must be text, a flag, a finite number of 64 bits, or a list of these, "
            f"got {shown(value)}"
        )
    return value
