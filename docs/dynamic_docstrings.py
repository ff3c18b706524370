"""A Griffe extension: a class or module that puts its docstring together when it is imported shows
that one.
"""

import inspect
from typing import Any

import griffe


class DynamicDocstrings(griffe.Extension):
    """Looks at classes and modules that assign `__doc__`."""

    def on_class_members(self, *, cls: griffe.Class, **_: Any) -> None:
        """Replace the docstring of the source by that of the imported class."""
        _replace(cls)

    def on_module_members(self, *, mod: griffe.Module, **_: Any) -> None:
        """The same for a module."""
        _replace(mod)


def _replace(documented: griffe.Class | griffe.Module) -> None:
    if "__doc__" in documented.members:
        imported = griffe.dynamic_import(documented.path)
        documented.docstring = griffe.Docstring(
            inspect.cleandoc(imported.__doc__), parent=documented
        )
