"""A Griffe extension for text that exists after an import only: docstrings that a module puts
together, and the allowed values of fields.
"""

import inspect
from dataclasses import fields
from typing import Any

import griffe

from care_sim.base.checks import allowed, bounded, one_of

_STATING = tuple(f"{each.__name__}(" for each in (bounded, one_of))
"""Beginnings of the value of a field that states its allowed values."""


class DynamicDocstrings(griffe.Extension):
    """Completes modules that assign `__doc__`, and dataclasses with allowed values."""

    def on_class_members(self, *, cls: griffe.Class, **_: Any) -> None:
        """Add the allowed values to the docstring of every field."""
        attributes = [each for each in cls.members.values() if each.is_attribute]
        # Importing every class of the package takes long.
        if not any(str(each.value).startswith(_STATING) for each in attributes):
            return
        told = {one.name: allowed(one) for one in fields(griffe.dynamic_import(cls.path))}
        for each in attributes:
            if values := told.get(each.name):
                about = each.docstring.value if each.docstring else ""
                text = f"{about}\n\nAllowed: {values.removeprefix('of ')}.".strip()
                each.docstring = griffe.Docstring(text, parent=each)

    def on_module_members(self, *, mod: griffe.Module, **_: Any) -> None:
        """Replace the docstring of the source by that of the imported module."""
        if "__doc__" in mod.members:
            imported = griffe.dynamic_import(mod.path)
            mod.docstring = griffe.Docstring(inspect.cleandoc(imported.__doc__), parent=mod)
