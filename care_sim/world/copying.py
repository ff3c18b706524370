"""Refuse to copy a world that holds functions with their own state.

`copy` and `pickle` keep a function as it is. A copied world's closure over an actor would still
move and read the actor of the original world. `values.pop` would take from the original's list.
"""

import dis
import pickle
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

from care_sim.base.errors import InvalidInput, error_line

_NOTHING = (repr, ("",))
"""Placeholder that the pickler writes for skipped objects."""
_UNCHANGING = (type(None), bool, int, float, complex, str, bytes, type, ModuleType)


def check_copyable(owner: object, what: str) -> None:
    """Raise InvalidInput where the state of `owner`, called `what` in the message, holds a function
    that has a state of its own, or something that nothing can copy.
    """
    try:
        _FunctionFinder(owner).dump(vars(owner))
    except InvalidInput as error:
        raise InvalidInput(f"{what} cannot be copied: {error}") from error
    # Somebody else's objects may fail in any way.
    except Exception as error:
        raise InvalidInput(f"{what} cannot be copied: {error_line(error)}") from error


class _FunctionFinder(pickle.Pickler):
    """A pickler that visits a state and keeps nothing of it."""

    def __init__(self, owner: object):
        super().__init__(BytesIO())
        self._owner = owner

    def reducer_override(self, found: object) -> Any:
        """Check a function. Pass over the owner, classes, and what copies itself."""
        # `copy.deepcopy` keeps it as it is, and with it the list that it is a method of.
        if isinstance(found, BuiltinFunctionType) and _changes(found):
            raise InvalidInput(
                f"{found.__qualname__} is held as a method of a {type(found.__self__).__name__}; "
                "use a method of an object of your own, or functools.partial"
            )
        if isinstance(found, FunctionType) and _has_state(found):
            code = found.__code__
            raise InvalidInput(
                f"{found.__qualname__} ({Path(code.co_filename).name}, line "
                f"{code.co_firstlineno}) is a closure with a state; use a method of an object, or "
                "functools.partial"
            )
        is_passed = isinstance(found, FunctionType | type) or hasattr(found, "__deepcopy__")
        return _NOTHING if is_passed or found is self._owner else NotImplemented


def _has_state(function: FunctionType) -> bool:
    """Whether a function holds what may change, or writes into what it holds."""
    code = function.__code__
    written = {each.argval for each in dis.get_instructions(code) if each.opname == "STORE_DEREF"}
    cells = function.__closure__ or ()
    held = [*(cell.cell_contents for cell in cells), *(function.__defaults__ or ())]
    held += (function.__kwdefaults__ or {}).values()
    return bool(written & {*code.co_freevars}) or _may_change(held)


def _may_change(values: Iterable[object]) -> bool:
    return any(map(_changes, values))


def _changes(value: object) -> bool:
    if isinstance(value, tuple | frozenset):
        return _may_change(value)
    if isinstance(value, FunctionType):
        return _has_state(value)
    if isinstance(value, BuiltinFunctionType):
        return _changes(value.__self__)
    return not isinstance(value, _UNCHANGING)
