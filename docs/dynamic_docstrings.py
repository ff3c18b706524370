"""A Griffe extension: a class that puts its docstring together when it is imported shows that one."""

import inspect
from typing import Any

import griffe


class DynamicDocstrings(griffe.Extension):
    """Looks at classes that assign `__doc__`."""

    def on_class_members(self, *, cls: griffe.Class, **_: Any) -> None:
        """Replace the docstring of the source by that of the imported class."""
        if "__doc__" in cls.members:
            imported = griffe.dynamic_import(cls.path)
            cls.docstring = griffe.Docstring(inspect.cleandoc(imported.__doc__), parent=cls)
