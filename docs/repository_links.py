"""An mkdocs hook: links between the files of the repository lead to the same pages on the site.
Tables of published studies get the name of their study and a link to the page that explains them.

The site begins in `docs/`, where `results` is a link to the folder beside it. A file view follows
no such link, so pages name each other by their places in the repository.
"""

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.pages import Page

_LINK = re.compile(r"\[([^\]]*)\]\((?![a-z]+:|#)([^)#\s]+)(#[^)\s]*)?\)")


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, **_: Any) -> str:
    """The text of a page with its links as the site needs them."""
    if page.file.abs_src_path is None:
        return markdown
    repository = Path(config.docs_dir).parent.resolve()
    place = Path(page.file.abs_src_path).resolve().relative_to(repository).as_posix()
    folder, name = posixpath.split(place)
    if name == "tables.md":
        markdown = _titled(markdown, folder)
    return _LINK.sub(lambda link: _on_site(link, place, page.file.src_uri, config), markdown)


def _titled(tables: str, folder: str) -> str:
    up = posixpath.relpath(".", folder)
    tables = tables.replace("`docs/reading.md`", f"[marks and terms]({up}/docs/reading.md)")
    return (
        tables if tables.startswith("# ") else f"# Tables: {posixpath.basename(folder)}\n\n{tables}"
    )


def _on_site(link: re.Match[str], place: str, page: str, config: MkDocsConfig) -> str:
    text, target, anchor = link.groups()
    target = posixpath.normpath(posixpath.join(posixpath.dirname(place), target))
    if not target.startswith(("docs/", "results/")) or config.exclude_docs.match_file(target):
        # The site does not hold the code: whoever reads it is told where the file lies.
        return f"{text} (`{target}`)"
    # A file view shows a notebook, the site has a page made of it (`notebook_page.py`).
    on_site = re.sub(r"\.ipynb$", ".md", target.removeprefix("docs/"))
    return f"[{text}]({posixpath.relpath(on_site, posixpath.dirname(page))}{anchor or ''})"
