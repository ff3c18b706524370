"""An mkdocs hook: marks the texts that a line break would spoil, for `site.css`."""

import re

from mkdocs.structure.pages import Page

_BLOCK = r"<pre.*?</pre>"
_SHORT_CODE = re.compile(_BLOCK + r"|<code>([^<]{1,28})</code>", re.DOTALL)
_LEVEL = r"(≤?[-+\d.]+|never)"
_INTERVAL = re.compile(rf"{_BLOCK}|<code.*?</code>|\[{_LEVEL}, {_LEVEL}\]", re.DOTALL)
_CELL = re.compile(r"<td>((?:<strong>)?[^<]{1,24}(?:</strong>)?)</td>")
_HEADING = re.compile(r"<td>(<em>[^<]*</em></td>)((?:\s*<td></td>)+)")


def on_page_content(html: str, *, page: Page, **_: object) -> str:
    """Keep options, intervals, and short cells of published tables on one line each."""
    # Other tables hold prose, which shall fill the width of a narrow screen.
    if page.file.src_uri.startswith("results/data/"):
        html = _CELL.sub(r'<td class="unbroken">\1</td>', html)
        html = _HEADING.sub(_over_the_columns, html)
    html = _SHORT_CODE.sub(_unbroken_code, html)
    return _INTERVAL.sub(_unbroken_interval, html)


def _over_the_columns(found: re.Match[str]) -> str:
    return f'<td colspan="{1 + found[2].count("<td>")}">{found[1]}'


def _unbroken_code(found: re.Match[str]) -> str:
    return f'<code class="unbroken">{found[1]}</code>' if found[1] else found[0]


def _unbroken_interval(found: re.Match[str]) -> str:
    return f"[{found[1]},&nbsp;{found[2]}]" if found[1] else found[0]
