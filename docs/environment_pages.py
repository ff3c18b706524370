"""Write docstrings into pages, so that a clone and the site show the same text.

A page marks the place of a docstring with comments, which no file view shows:

    <!-- from care_sim.envs.scenarios.DenseEnv -->
    text
    <!-- end -->

`from A beyond B` lists the fields of A without those that B lists alike.

`python docs/environment_pages.py` rewrites all texts. A test fails where a text differs from its
docstring.
"""

import importlib
import inspect
import re
import textwrap
from dataclasses import MISSING, Field, fields, is_dataclass
from pathlib import Path
from typing import Any

import docstring_parser

from care_sim.base.checks import allowed

DOCS = Path(__file__).parent
PAGES = (*sorted((DOCS / "environments").glob("*.md")), DOCS / "api" / "conditions.md")
_REGION = re.compile(
    r"<!-- from (?P<path>\S+)(?: beyond (?P<base>\S+))? -->\n.*?<!-- end -->", re.S
)
_SHARED = {
    "care_sim.envs.closed_loop.ClosedLoopEnv": "care_sim.envs.conditions_page.CONDITIONS",
    "care_sim.envs.open_loop.OpenLoopEnv": "",
}
"""Environments whose whole docstring a page shows, but for the text that another page shows."""
_COLUMNS = 118
_LONGEST_LIST = 90
"""Characters of allowed values. The page of a longer list explains the values in its own text."""


def written(page: Path) -> str:
    """Return the page with its texts as the docstrings are now."""

    def text_of(region: re.Match[str]) -> str:
        text = _described(region["path"], region["base"]).strip()
        head = region[0].partition("\n")[0]
        return f"{head}\n{text}\n<!-- end -->"

    return _REGION.sub(text_of, page.read_text(encoding="utf-8"))


def _found(path: str) -> Any:
    """Return the class or text of a dotted path."""
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


def _described(path: str, base: str | None = None) -> str:
    one = _found(path)
    if isinstance(one, str):
        return one
    if is_dataclass(one):
        known = _field_lines(_found(base)) if base else []
        return "\n".join(line for line in _field_lines(one) if line not in known)
    about = inspect.cleandoc(one.__doc__ or "")
    if path not in _SHARED:
        # The summary and sections of the loop follow, which have a page of their own.
        return about.partition("\n### ")[0].rstrip().rpartition("\n\n")[0]
    if _SHARED[path]:
        about = about.removesuffix(inspect.cleandoc(_found(_SHARED[path])))
    return about.partition("\n\n")[2].replace("\n### ", "\n## ").replace("### ", "## ", 1)


def _field_lines(one: Any) -> list[str]:
    """Return a list item per field, also inherited: default, allowed values, docstring."""
    told: dict[str, str] = {}
    for kind in filter(is_dataclass, reversed(one.__mro__)):
        for each in docstring_parser.parse_from_object(kind).params:
            told[each.arg_name] = " ".join((each.description or "").split())
    points = [
        ": ".join(filter(None, [_headed(field), told.get(field.name)])) for field in fields(one)
    ]
    wrapped = textwrap.TextWrapper(
        _COLUMNS, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
    )
    return [*map(wrapped.fill, points)]


def _headed(field: Field[Any]) -> str:
    """Return a field's name and default, and its allowed values in brackets."""
    values = allowed(field)
    if len(values) > _LONGEST_LIST:
        values = f"of {values.count(',') + 1} names"
    return f"- `{field.name}{_default(field)}`" + (f" ({values})" if values else "")


def _default(field: Field[Any]) -> str:
    """Return `=DEFAULT`, or nothing for a field without a default."""
    return "" if field.default is MISSING else f"={_rounded(field.default)}"


def _rounded(value: Any) -> str:
    """Return a default as text, numbers to four digits."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_rounded, value))})"
    return f"{value:.4g}" if isinstance(value, float) else repr(value)


def main() -> None:
    """Rewrite all pages."""
    for page in PAGES:
        page.write_text(written(page), encoding="utf-8")


if __name__ == "__main__":
    main()
