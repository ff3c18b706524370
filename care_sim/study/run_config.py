"""What a study hands to its workers: a policy with its parameters, and the world that it meets,
named by a digest.

The configurations of the closed loop (`care_sim.study.episode_config`) and of the open loop
(`care_sim.study.play_config`) have this base.
"""

import ast
import hashlib
import json
import os
import warnings
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from copy import copy
from functools import cached_property
from typing import Any, Self

import gymnasium
import numpy as np

import care_sim
from care_sim.base.digests import file_digest, paths_in
from care_sim.base.errors import InvalidInput, one_line, shown
from care_sim.core.conditions import DEFAULTS, UNUSED_BY_FULL_SCAN
from care_sim.policies import check_policy, make_policy
from care_sim.policies.base import Policy
from care_sim.study.provenance import SESSION, code_digest, policy_digest

Parameters = tuple[tuple[str, Any], ...]
"""Names and values, of a scenario's physics, a policy or a detector."""

_ALLOWED = "a flag, a number of at most 64 bits, a text, or a list of one kind of these"
_DEEPEST = 4
"""Levels that lists may be nested."""
_WHOLE = 2**63
"""Whole numbers have 64 bits in a column: from minus this to less than this."""
_LONGEST = 8192
"""Characters of a parameter: a path and its name fit."""


def checked_parameters(given: Iterable[tuple[str, Any]], whose: str) -> Parameters:
    """The parameters with values of Python's own types, lists as tuples, paths as texts.

    Raises InvalidInput for a value or a name that a journal and a column of a results file would
    not give back: sets, maps, bytes, None, which a column reads as not given, NaN, halves of
    characters, lists of several kinds.
    """
    return tuple(
        (_name(name, whose), _checked(f"{whose} parameter {name}", value)) for name, value in given
    )


def _checked(what: str, value: Any) -> Any:
    try:
        plain = _plain(value)
        _kind(plain)
    except (ValueError, TypeError, OverflowError) as error:
        raise InvalidInput(f"{one_line(what)} must be {_ALLOWED}, got {shown(value)}") from error
    return plain


def _name(name: Any, whose: str) -> str:
    try:
        return _text(name)
    except (ValueError, TypeError) as error:
        raise InvalidInput(
            f"the name of a {whose} parameter must be a text, got {shown(name)}"
        ) from error


def _plain(value: Any, levels: int = _DEEPEST) -> Any:
    """The value in Python's own types. Raises ValueError or TypeError where it is not allowed."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple) and levels:
        return tuple(_plain(each, levels - 1) for each in value)
    # Before int, of which bool is a subclass.
    if isinstance(value, bool):
        return value
    if isinstance(value, int) and -_WHOLE <= value < _WHOLE:
        return int(value)
    # NaN is no value: no row with it would be equal to itself.
    if isinstance(value, float) and value == value:
        return float(value)
    # Texts pass through fspath unchanged. Anything else that is no path raises TypeError.
    return _text(os.fspath(value))


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    # Lone surrogates, which no file can hold, raise here.
    value.encode()
    # A subclass of str, such as an enum, becomes a plain str.
    return str.__str__(value)


def _kind(value: Any) -> Any:
    """The kind of values that a column of such values holds. Raises ValueError for a list of
    several kinds.
    """
    if not isinstance(value, tuple):
        # A column of numbers may mix whole ones with others.
        return float if type(value) is int else type(value)
    kinds = {_kind(each) for each in value}
    if len(kinds) > 1:
        raise ValueError
    return (*kinds,)


def parameters(texts: Sequence[str]) -> Parameters:
    """Parameters given as NAME=VALUE. Raises InvalidInput for another form, and for a name that is
    given twice.
    """
    pairs = tuple(_pair(text) for text in texts)
    for name, count in Counter(name for name, _ in pairs).items():
        if count > 1:
            raise InvalidInput(f"a parameter is given once, got {shown(name)} {count} times")
    return pairs


def _pair(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise InvalidInput(f"parameters are given as NAME=VALUE, got {shown(text)}")
    if len(text) > _LONGEST:
        raise InvalidInput(
            f"a parameter must be at most {_LONGEST} characters long, got {shown(text)}"
        )
    # A Windows path holds backslashes that Python warns of as escapes.
    with warnings.catch_warnings(action="ignore", category=SyntaxWarning):
        try:
            literal = ast.literal_eval(value)
        except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
            literal = value  # no literal, or one nested deeper than any parameter is
    return name, tuple(literal) if isinstance(literal, list) else literal


Row = dict[str, Any]

SimilarityKey = tuple[object, ...]
"""What tasks have in common that take about as long."""

MOST_TASKS = 100_000
"""Tasks of a study, whose rows it holds in memory: 10 to 20 kB each, 1 to 2 GB in all."""

CONDITION_NAMES = [*DEFAULTS]
REFERENCE = "care"
"""The policy that others are compared with."""
FULL = "full"
"""The policy that scans everything."""


class RunConfig(ABC):
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
        """Tasks with equal ones may be handed to one worker together."""

    @property
    @abstractmethod
    def similarity_keys(self) -> tuple[SimilarityKey, ...]:
        """What it shares with tasks that take about as long, the closest first."""

    def make_policy(self, env: gymnasium.Env[Any, Any]) -> Policy:
        """The policy for the environment."""
        policy = make_policy(self.policy, env, **dict(self.policy_parameters))
        # For what it remembers: files of code are hashed once per process, as they are when first
        # asked for. Making the policy may have loaded more of them, and an edit while it plays must
        # not change what `digest` says of them.
        self.installed()
        return policy

    def digest(self, code: str | None = None) -> str:
        """Hash of the configuration and of all code and files that decide the row; `code` is the
        `code_digest` where the caller has it.

        A row carries the digest that its worker worked out after playing it. Where code has no
        source to read, the name of this run stands for it, so that no other run has the digest.
        """
        own = (self._session if digest is None else digest for digest in self.installed())
        # Sorted, so that the order of the columns does not matter.
        parameters = sorted(self.row().items())
        effective = [parameters, care_sim.__version__, code or code_digest(), *own]
        return hashlib.sha256(json.dumps(effective).encode()).hexdigest()[:16]

    def installed(self) -> list[str | None]:
        """Hashes of what else decides the row: code of other packages, and the files that
        parameters name. None stands for code that has no source to read.
        """
        return [policy_digest(self.policy), *files_in(self.policy_parameters)]

    @cached_property
    def key(self) -> str:
        """The digest when this process first asked for it.

        The process that leads a study files the row under it, whatever changes while it runs, and
        refuses a row with another digest.
        """
        return self.digest()

    def __getstate__(self) -> dict[str, Any]:
        # Workers are sent no key, so that each works out its own and one with other code shows.
        # They are sent `_session`, which has no meaning of its own there. It is set once the key
        # was asked for, as the study does before it hands out tasks.
        return {name: value for name, value in vars(self).items() if name != "key"}

    @cached_property
    def _session(self) -> str:
        """The name of the run that leads the study; stands for code that cannot be read."""
        return SESSION

    def changed(self, **values: object) -> Self:
        """The same with other values of fields that need no check."""
        # dataclasses.replace would run every check again, and make an environment for each task of
        # a large study.
        other = copy(self)
        for name, value in values.items():
            object.__setattr__(other, name, value)
        return other

    def check_parameters(self, *names: str) -> None:
        """Bring the parameters in these fields into the form in which files hold them. Raises
        InvalidInput for values that no file holds.
        """
        for name in names:
            pairs = getattr(self, name)
            if not (isinstance(pairs, tuple | list) and all(map(_is_pair, pairs))):
                raise InvalidInput(
                    f"{name} must be pairs of a name and a value, got {shown(pairs)}"
                )
            object.__setattr__(
                self, name, checked_parameters(pairs, name.removesuffix("_parameters"))
            )


def departures(task: RunConfig, without: Sequence[str]) -> list[str]:
    """What of a task's row departs from the default conditions, as NAME=VALUE."""
    return [f"{n}={v}" for n, v in task.row().items() if n not in without and v != DEFAULTS.get(n)]


def effective_conditions(policy: str, budget: float, conditions: dict[str, Any]) -> dict[str, Any]:
    """Budget and conditions as a policy feels them. The full scan has one budget, and asks neither
    camera nor allocator.
    """
    check_policy(policy)
    felt = conditions | {"budget": budget}
    if parameters := conditions.get("policy_parameters"):
        felt["policy_parameters"] = parameters_for(policy, parameters)
    if policy == FULL:
        # Whatever it does not feel takes the default, so that equal full scans are one
        # configuration and run once.
        felt |= {"budget": 1.0} | {name: DEFAULTS[name] for name in UNUSED_BY_FULL_SCAN}
    return felt


def parameters_for(policy: str, parameters: Parameters) -> Parameters:
    """The parameters of one policy among those for several: NAME is for all, POLICY.NAME for that
    policy alone.

    Raises InvalidInput for a name before the point that is no policy.
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
    """Raise InvalidInput for more tasks than a study can hold; asked before they are made."""
    if tasks > MOST_TASKS:
        raise InvalidInput(
            f"the tasks of a study must be at most {MOST_TASKS:,}, got {shown(tasks)}, because all "
            "their rows are held in memory: play it in parts, each with its own --out"
        )


def in_batches(tasks: Sequence[RunConfig], most: int | None = None) -> list[list[RunConfig]]:
    """The tasks in the order in which they are played; tasks of one batch stand together, up to
    `most` of them.
    """
    batches: list[list[RunConfig]] = []
    begun: dict[Hashable, list[RunConfig]] = {}
    # The sort is stable: a batch is played when its first task is due.
    for task in sorted(tasks, key=lambda task: task.order):
        key = task.batch
        if key not in begun or len(begun[key]) == most:
            begun[key] = []
            batches.append(begun[key])
        begun[key].append(task)
    return batches


def collected(plain: Sequence[dict[str, Any]], axis: str, plural: str) -> dict[str, Any]:
    """Configurations as plain data, each once, with all values of an axis under its plural and all
    policies under `policies`. Shared values are stored once, under `common`: otherwise large
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
