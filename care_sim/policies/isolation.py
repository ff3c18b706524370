"""Foreign policies in their own processes. Such a process receives the rig, public settings and
observations, and returns actions. The environment stays in another process, out of reach of frames
and of the garbage collector.

Results are read as JSON and plain arrays. They are never unpickled, because that would run code of
the policy outside its process.
"""

import json
import os
import pickle
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from io import BytesIO
from itertools import count
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, TypeAlias
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import (
    LONGEST,
    BrokenPolicy,
    InvalidInput,
    MissingExtra,
    failure_line,
    one_line,
    shortened,
)
from care_sim.base.processes import LOOK_S, end_with_parent, flush_output, lead_group, starting
from care_sim.core.belief import Belief, Observation
from care_sim.core.cells.sets import CellSets
from care_sim.core.rig import Rig
from care_sim.core.types import Action, Demand
from care_sim.policies.base import Policy
from care_sim.policies.makers import (
    PolicyMaker,
    check_parameters,
    is_privileged,
    made,
    policy_faults,
    tags_of_maker,
)

_Load: TypeAlias = Callable[[str], PolicyMaker]
"""Function that loads a policy by its name."""
_MOST_BYTES = 2**28
"""Largest answer in bytes; an action of the default grid has 65,536."""
_ERRORS = {kind.__name__: kind for kind in (BrokenPolicy, InvalidInput, MissingExtra)}
"""Errors that keep their class on their way out of a process, narrow ones first."""


def isolate_policies() -> None:
    """From now on, load and play policies that are not built in only in their own processes."""
    if _PROCESSES.get() is None:
        _PROCESSES.set({})


@contextmanager
def isolated_policies() -> Iterator[None]:
    """Isolate policies until the end of the block, then end their processes."""
    if are_isolated():
        yield
        return
    processes: dict[str, PolicyProcess] = {}
    before = _PROCESSES.set(processes)
    try:
        yield
    finally:
        _PROCESSES.reset(before)
        for process in processes.values():
            process.end()


def are_isolated() -> bool:
    """Return True if policies that are not built in play in their own processes."""
    return _PROCESSES.get() is not None


def policy_process(name: str) -> "PolicyProcess":
    """Return the process of a policy, a new one if it has none or its process has died."""
    processes = _PROCESSES.get()
    assert processes is not None
    if name not in processes or not processes[name].is_usable:
        processes[name] = PolicyProcess(name)
    return processes[name]


class PolicyProcess:
    """The process of the policy `name`, which runs requested functions one at a time."""

    def __init__(self, name: str):
        self.name = name
        self.is_usable = True
        self._dropped: list[int] = []
        # A fork would copy the memory of this process, environments and seeds included.
        context = get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), name=name, daemon=True)
        with starting():
            self._process.start()
        theirs.close()

    def ask(self, function: Callable[..., object], *arguments: object) -> bytes:
        """Call a function in the process and return its result: bytes as they are, anything else as
        JSON.

        Raises the function's error, as a single line, and BrokenPolicy if the process dies.
        """
        dropped = self._dropped[:]
        del self._dropped[: len(dropped)]
        try:
            self._connection.send((dropped, function, arguments))
            self._wait()
            answer = self._connection.recv_bytes(_MOST_BYTES)
        except (EOFError, OSError) as error:
            self.end()
            raise BrokenPolicy(f"the process of policy {self.name} died") from error
        if answer[:1] == b"+":
            return answer[1:]
        raise self.read(_rebuild_error, answer[1:])

    def read(self, function: Callable[[bytes], Any], answer: bytes) -> Any:
        """Read an answer with a function. Raises BrokenPolicy where the function fails."""
        try:
            return function(answer)
        except Exception as error:
            raise BrokenPolicy(f"policy {self.name} answers with no action: {error}") from error

    def drop(self, number: int) -> None:
        """Make the process forget a policy object before its next task."""
        self._dropped.append(number)

    def end(self) -> None:
        """End the process, and those that it has started."""
        if not self.is_usable:
            return
        self.is_usable = False
        if pid := self._process.pid:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(pid, signal.SIGKILL)
        self._process.kill()
        self._process.join()
        self._connection.close()

    def _wait(self) -> None:
        # A process that the policy has forked keeps the connection open, so a closed connection is
        # no sign of its end.
        while not self._connection.poll(LOOK_S):
            if not self._process.is_alive() and not self._connection.poll(0):
                raise EOFError


_PROCESSES: ContextVar[dict[str, PolicyProcess] | None] = ContextVar("processes", default=None)


class IsolatedMaker:
    """Makes a policy in its process. Raises InvalidInput with the reason if it cannot be loaded."""

    def __init__(self, name: str, load: _Load):
        self._process = policy_process(name)
        self._load = load
        self._process.read(self._describe, self._process.ask(_described, name, load))
        # Foreign code may have returned anything.
        for fault in policy_faults(self):
            raise InvalidInput(f"{name} {fault}")

    def _describe(self, answer: bytes) -> None:
        about = json.loads(answer)
        self.tags = tuple(about["tags"])
        self.told = about["told"]
        self.source = about["source"]
        self.is_pattern = bool(about["is_pattern"])

    def __call__(self, rig: Rig, **parameters: object) -> Policy:
        """Return the policy for a rig."""
        name = self._process.name
        number = self._process.ask(_make, name, self._load, rig, parameters)
        return IsolatedPolicy(self._process, rig, self._process.read(int, number))


class IsolatedPolicy(Policy):
    """A policy that its process holds under a `number`."""

    def __init__(self, process: PolicyProcess, rig: Rig, number: int):
        super().__init__(rig)
        self._process = process
        self._number = number
        finalize(self, process.drop, number)

    def reset(self) -> None:
        """Forget the episode."""
        self._process.ask(_reset, self._number)

    def demand(self, belief: Belief) -> Demand:
        """Raise InvalidInput: the process takes only observations."""
        raise InvalidInput("a policy in a process of its own is called with an observation")

    def __call__(self, observation: Observation) -> Action:
        """Return the action for an observation, computed in the process."""
        answer = self._process.ask(_act, self._number, dict(observation))
        action: Action
        action, self.demanded = self._process.read(self._read, answer)
        return action

    def _read(self, answer: bytes) -> tuple[Action, Demand | None]:
        file = BytesIO(answer)
        action: NDArray[np.float32] = np.load(file, allow_pickle=False)
        if file.tell() == len(answer):
            return action, None
        cells, sizes = (np.load(file, allow_pickle=False).astype(np.int64) for _ in range(2))
        # Compiled code uses these numbers without a check of bounds.
        in_grid = 0 <= cells.min(initial=0) <= cells.max(initial=0) < self.rig.grid.size
        if not in_grid or sizes.min(initial=0) < 0 or sizes.sum() != cells.size:
            raise ValueError("its sets are of other cells than the grid has")
        return action, Demand(CellSets(cells.ravel(), sizes.ravel()))


_MADE: dict[int, Policy] = {}
"""The policy objects of this process, by number."""
_NUMBERS = count()


def _serve(connection: Connection) -> None:
    """Run requested functions until the process at the other end is gone."""
    end_with_parent()
    lead_group()
    while True:
        try:
            request = connection.recv_bytes()
        except EOFError:
            return
        answer = _answer(request)
        flush_output()
        connection.send_bytes(answer)


def _answer(request: bytes) -> bytes:
    try:
        dropped, function, arguments = pickle.loads(request)
        for number in dropped:
            _MADE.pop(number, None)
        answer = function(*arguments)
        return b"+" + (answer if isinstance(answer, bytes) else json.dumps(answer).encode())
    except BaseException as error:
        kind = next((name for name, each in _ERRORS.items() if isinstance(error, each)), "")
        told = str(error) if kind == MissingExtra.__name__ else failure_line(error)
        return b"-" + json.dumps([kind, told]).encode()


def _rebuild_error(answer: bytes) -> Exception:
    kind, told = json.loads(answer)
    return _ERRORS.get(str(kind), InvalidInput)(shortened(one_line(str(told)), LONGEST))


def _described(name: str, load: _Load) -> dict[str, Any]:
    make = load(name)
    return {
        "tags": tags_of_maker(make),
        "told": dict(getattr(make, "told", Policy.told)),
        "source": getattr(make, "source", ""),
        "is_pattern": bool(getattr(make, "is_pattern", Policy.is_pattern)),
    }


def _make(name: str, load: _Load, rig: Rig, parameters: dict[str, object]) -> int:
    make = load(name)
    if is_privileged(make):
        raise BrokenPolicy(
            f"policy {name} needs the truth, which a policy in a process of its own cannot have"
        )
    check_parameters(name, make, parameters)
    number = next(_NUMBERS)
    _MADE[number] = made(name, make, [rig], parameters)
    return number


def _reset(number: int) -> None:
    _MADE[number].reset()


def _act(number: int, observation: Observation) -> bytes:
    policy = _MADE[number]
    file = BytesIO()
    np.save(file, np.asarray(policy(observation)), allow_pickle=False)
    if policy.demanded is not None:
        sets = CellSets.of(policy.demanded.exploitation)
        np.save(file, sets.cells, allow_pickle=False)
        np.save(file, sets.sizes, allow_pickle=False)
    return file.getvalue()
