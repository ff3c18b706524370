"""Configuration of a worker's task: a policy with its parameters, and its world, identified by a
digest.

The configurations of the closed loop (`care_sim.study.episode_config`) and of the open loop
(`care_sim.study.play_config`) have this base.
"""

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from copy import copy
from functools import cached_property
from typing import Any, ClassVar, Self

import gymnasium

import care_sim
from care_sim.base.digests import file_digest, paths_in
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import DEFAULTS, UNUSED_BY_FULL_SCAN
from care_sim.core.firing.listing import hardware_of
from care_sim.perception.detectors import PROXY, check_detector
from care_sim.policies import POLICIES, check_policy, make_policy, maker
from care_sim.policies.base import Policy
from care_sim.policies.makers import check_parameters
from care_sim.study.provenance import SESSION, code_digest, policy_digest
from care_sim.study.rows.parameters import Parameters, checked_parameters

Row = dict[str, Any]

MOST_TASKS = 100_000
"""Most tasks of a study, which holds its rows in memory: 10 to 20 kB each, 1 to 2 GB in all."""

REFERENCE = "care"
"""The reference policy."""
FULL = "full"
"""The policy that scans everything."""
_OWNERS = ("detector", "scenario", "policy")
"""Kinds with their own parameters."""
_NAMED = {"scenario", "scene", "policy", "budget", "seed"}
"""Columns in the name of a task."""


class RunConfig(ABC):
    """Everything that decides a row of a study. Subclasses are frozen dataclasses.

    A subclass checks its fields. The environment and the policy check the rest when they are made,
    by `try_out` or by the first play.
    """

    policy: str
    budget: float
    detector: str
    detector_parameters: Parameters
    policy_parameters: Parameters
    firing: str

    columns: ClassVar[Sequence[str]]
    """Fields that are a column of every row."""
    usual: ClassVar[Mapping[str, Any]]
    """Fields that are a column if they differ from this value. Otherwise rows and their digests
    equal those of older versions.
    """

    @abstractmethod
    def place(self) -> Row:
        """Columns of the task's place: the sensor set-up, the source of a scene."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Return the name of a task for people."""

    @property
    def order(self) -> int:
        """Tasks with lower numbers are played first."""
        return 0

    @property
    @abstractmethod
    def batch(self) -> Hashable:
        """One worker may play tasks with equal keys together."""

    @abstractmethod
    def try_out(self) -> None:
        """Make environment and policy. Raises what they do not accept."""

    def row(self) -> Row:
        """Return all parameters as columns; those of detector, scenario and policy as
        `detector.NAME`, `scenario.NAME`, `policy.NAME`.
        """
        plain = {name: getattr(self, name) for name in self.columns}
        chosen = {name: getattr(self, name) for name in self.usual}
        row = self.place() | plain
        row |= {name: value for name, value in chosen.items() if value != self.usual[name]}
        for owner in _OWNERS:
            row |= flat(owner, getattr(self, f"{owner}_parameters", ()))
        return row

    @property
    def label(self) -> str:
        """Return a short readable name: the name, and parameters other than defaults."""
        told = {*self.place(), *_NAMED} - {"sensor"}
        usual = DEFAULTS | {"detector": PROXY}
        changes = {n: v for n, v in self.row().items() if n not in told and v != usual.get(n)}
        return " ".join([self.name, *(f"{name}={value}" for name, value in changes.items())])

    def make_policy(self, env: gymnasium.Env[Any, Any]) -> Policy:
        """The policy for the environment."""
        policy = make_policy(self.policy, env, **dict(self.policy_parameters))
        # Fills the cache: files of code are hashed once per process, at first use. Making the
        # policy may have loaded more files, and an edit during the play must not change `digest`.
        self.installed()
        return policy

    def digest(self, code: str | None = None) -> str:
        """Hash the configuration and all code and files that decide the row; `code` is the
        `code_digest`, if known.

        A row holds the digest that its worker computed after playing it. Code without readable
        source is replaced by the name of this run, so that no other run has the digest.
        """
        own = (self._session if digest is None else digest for digest in self.installed())
        # Sorted, so that the order of the columns does not matter.
        parameters = sorted(self.row().items())
        effective = [parameters, care_sim.__version__, code or code_digest(), *own]
        return hashlib.sha256(json.dumps(effective).encode()).hexdigest()[:16]

    def installed(self) -> list[str | None]:
        """Return hashes of other packages' code, and of the files in parameters. None stands for
        code without readable source.
        """
        return [policy_digest(self.policy), *files_in(self.policy_parameters)]

    @cached_property
    def key(self) -> str:
        """The digest at its first use in this process.

        The leading process of a study stores the row under it, whatever changes meanwhile, and
        refuses a row with another digest.
        """
        return self.digest()

    def __getstate__(self) -> dict[str, Any]:
        # Workers get no key, so that each computes its own, which reveals other code. They get
        # `_session`, which only the leading process defines. It is set with the key, before the
        # study submits tasks.
        return {name: value for name, value in vars(self).items() if name != "key"}

    @cached_property
    def _session(self) -> str:
        """The name of the leading run, which replaces code that cannot be read."""
        return SESSION

    def changed(self, **values: object) -> Self:
        """Return a copy with other values of fields that need no check."""
        # dataclasses.replace would run every check again for each task of a large study.
        other = copy(self)
        for name, value in values.items():
            object.__setattr__(other, name, value)
        return other

    def check_task(self, grid: Grid) -> None:
        """Check policy, detector and budget for the cells of a grid, and convert all parameters to
        the form of files. Raises InvalidInput.
        """
        for owner in _OWNERS:
            name = f"{owner}_parameters"
            pairs = getattr(self, name, ())
            if not (isinstance(pairs, tuple | list) and all(map(_is_pair, pairs))):
                raise InvalidInput(
                    f"{name} must be pairs of a name and a value, got {shown(pairs)}"
                )
            object.__setattr__(self, name, checked_parameters(pairs, owner))
        check_policy(self.policy)
        check_detector(self.detector)
        hardware_of(self.firing, grid).budget_cells(self.budget)
        # Foreign code is loaded when it plays.
        if self.policy in POLICIES.built_in:
            check_parameters(self.policy, maker(self.policy), dict(self.policy_parameters))


def effective_conditions(policy: str, budget: float, conditions: dict[str, Any]) -> dict[str, Any]:
    """Return the effective budget and conditions of a policy. The full scan has one budget, and
    uses neither camera nor allocator.
    """
    check_policy(policy)
    felt = conditions | {"budget": budget}
    if parameters := conditions.get("policy_parameters"):
        felt["policy_parameters"] = parameters_for(policy, parameters)
    if policy == FULL:
        # Reset conditions that `full` ignores, so that equal full scans are one configuration and
        # run once.
        felt |= {"budget": 1.0} | {name: DEFAULTS[name] for name in UNUSED_BY_FULL_SCAN}
    return felt


def parameters_for(policy: str, parameters: Parameters) -> Parameters:
    """Return the parameters of one policy among those for several: NAME is for all, POLICY.NAME
    only for that policy.

    Raises InvalidInput for an unknown policy before the dot.
    """
    # rpartition leaves everything in the last part where there is no point.
    parted = [(*name.rpartition("."), value) for name, value in parameters]
    for owner, point, _, _ in parted:
        if point:
            check_policy(owner)
    return tuple(
        (name, value) for owner, point, name, value in parted if not point or owner == policy
    )


def files_in(parameters: Parameters) -> list[str | None]:
    """Hashes of the files and folders that parameters name; None of a folder with too many files to
    be read.
    """
    return [file_digest(path) for _, value in parameters for path in paths_in(value)]


def flat(prefix: str, parameters: Parameters) -> Row:
    """Parameters as columns."""
    return {f"{prefix}.{name}": value for name, value in parameters}


def check_size(tasks: int) -> None:
    """Raise InvalidInput for more tasks than a study can hold; call it before they are made."""
    if tasks > MOST_TASKS:
        raise InvalidInput(
            f"the tasks of a study must be at most {MOST_TASKS:,}, got {shown(tasks)}, because all "
            "their rows are held in memory: play it in parts, each with its own --out"
        )


def collected(plain: Sequence[dict[str, Any]], axis: str, plural: str) -> dict[str, Any]:
    """Return configurations as plain data, each once. All values of an axis are under its plural,
    all policies under `policies`. Shared values are stored once, under `common`: otherwise large
    studies write megabytes.
    """
    listed = _grouped(_grouped(plain, axis, plural), "policy", "policies")
    common = {
        name: value
        for name, value in listed[0].items()
        if name not in (plural, "policies")
        and all(name in one and one[name] == value for one in listed)
    }
    own = [{key: value for key, value in one.items() if key not in common} for one in listed]
    return {"common": common, "configurations": own}


def _grouped(plain: Sequence[dict[str, Any]], name: str, plural: str) -> list[dict[str, Any]]:
    """Configurations that differ only in `name` as one, with the list of its values."""
    grouped: dict[str, dict[str, Any]] = {}
    for one in plain:
        rest = {other: value for other, value in one.items() if other != name}
        grouped.setdefault(json.dumps(rest), {**rest, plural: []})[plural].append(one[name])
    return list(grouped.values())


def _is_pair(given: object) -> bool:
    return isinstance(given, tuple | list) and len(given) == 2
