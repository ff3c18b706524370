"""A Griffe extension: what is only known when a module is imported. A class or module that puts its
docstring together shows that one, and a field tells its bounds or names.
"""

import inspect
from dataclasses import fields
from typing import Any

import griffe

from care_sim.base.checks import allowed, bounded, one_of

_STATING = tuple(f"{each.__name__}(" for each in (bounded, one_of))
"""How the value of a field begins that states what it may be."""


class DynamicDocstrings(griffe.Extension):
    """Looks at classes and modules that assign `__doc__`, and at dataclasses."""

    def on_class_members(self, *, cls: griffe.Class, **_: Any) -> None:
        """Replace the docstring of the source by that of the imported class, and tell of every
        field what it may be.
        """
        _replace(cls)
        _tell_values(cls)

    def on_module_members(self, *, mod: griffe.Module, **_: Any) -> None:
        """The same for a module."""
        _replace(mod)


def _replace(documented: griffe.Class | griffe.Module) -> None:
    if "__doc__" in documented.members:
        imported = griffe.dynamic_import(documented.path)
        documented.docstring = griffe.Docstring(
            inspect.cleandoc(imported.__doc__), parent=documented
        )


def _tell_values(documented: griffe.Class) -> None:
    attributes = [each for each in documented.members.values() if each.is_attribute]
    # To import every class of the package takes long: only those are that state what is allowed.
    if not any(str(each.value).startswith(_STATING) for each in attributes):
        return
    told = {one.name: allowed(one) for one in fields(griffe.dynamic_import(documented.path))}
    for each in attributes:
        if values := told.get(each.name):
            about = each.docstring.value if each.docstring else ""
            text = f"{about}\n\nAllowed: {values.removeprefix('of ')}.".strip()
            each.docstring = griffe.Docstring(text, parent=each)
