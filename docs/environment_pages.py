"""Pages that are read in a clone and on the site: what the site makes of a docstring stands in a
page as text, too.

A page holds the directive in a comment, which no file view shows, and behind it the text:

    <!-- site
    ::: care_sim.envs.scenarios.DenseEnv
    -->
    text
    <!-- end -->

`python docs/environment_pages.py` writes the texts anew; a test says where one is not as its
docstring. As an mkdocs hook this module puts the directive in the place of both.
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

PAGES = Path(__file__).parent / "environments"
_REGION = re.compile(r"<!-- site\n(?P<directive>::: (?P<path>\S+)\n.*?)-->\n.*?<!-- end -->", re.S)
_SHARED = {"ClosedLoopEnv": "dartout.md", "OpenLoopEnv": "street.md"}
"""The pages that hold what all environments of a loop share."""
_COLUMNS = 118


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The page as the site needs it: mkdocs calls this."""
    return _REGION.sub(lambda region: region["directive"], markdown)


def written(page: Path) -> str:
    """The page with its texts as the docstrings are now."""

    def text_of(region: re.Match[str]) -> str:
        text = _described(_found(region["path"]), page.name).strip()
        return f"<!-- site\n{region['directive']}-->\n{text}\n<!-- end -->"

    return _REGION.sub(text_of, page.read_text(encoding="utf-8"))


def _found(path: str) -> Any:
    """The module or class of a dotted path."""
    try:
        return importlib.import_module(path)
    except ModuleNotFoundError:
        module, _, name = path.rpartition(".")
        return getattr(importlib.import_module(module), name)


def _described(one: Any, page: str) -> str:
    if inspect.ismodule(one):
        return inspect.getdoc(one) or ""
    about = inspect.cleandoc(one.__doc__ or "")
    if is_dataclass(one):
        return "\n\n".join([about, "\n".join(_field_lines(one))])
    # Of environments: their own part, and the page of the one that tells what all share.
    shared = next(_SHARED[kind.__name__] for kind in one.__mro__ if kind.__name__ in _SHARED)
    if page == shared:
        return about
    own = about.partition("\n### ")[0].strip()
    return (
        f"{own}\n\nAction, observation, reward, episode end, info and the arguments that all such "
        f"environments\nhave stand on [this page]({shared})."
    )


def _field_lines(one: Any) -> list[str]:
    """A point for every field that the class itself has, with default and docstring."""
    params = docstring_parser.parse_from_object(one).params
    told = {each.arg_name: " ".join((each.description or "").split()) for each in params}
    own = [field for field in fields(one) if field.name in inspect.get_annotations(one)]
    points = [": ".join(filter(None, [_headed(field), told.get(field.name)])) for field in own]
    wrapped = textwrap.TextWrapper(
        _COLUMNS, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
    )
    return [*map(wrapped.fill, points)]


def _headed(field: Field[Any]) -> str:
    """The name of a field, what it is unless given, and in brackets what it may be."""
    values = allowed(field)
    return f"- `{field.name}{_default(field)}`" + (f" ({values})" if values else "")


def _default(field: Field[Any]) -> str:
    """What a field is unless it is given; empty where there is no such value."""
    return "" if field.default is MISSING else f"={_rounded(field.default)}"


def _rounded(value: Any) -> str:
    """A default, numbers to four digits."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_rounded, value))})"
    return f"{value:.4g}" if isinstance(value, float) else repr(value)


def main() -> None:
    """Write all pages."""
    for page in sorted(PAGES.glob("*.md")):
        page.write_text(written(page), encoding="utf-8")


if __name__ == "__main__":
    main()
