"""Builds the page of a folder of results."""

import json
import re
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markdown_it import MarkdownIt
from markupsafe import Markup

import care_sim
from care_sim.base.errors import InvalidInput, counted, printable_lines
from care_sim.base.files import HTML, json_content, replacing
from care_sim.core.conditions import DEFAULTS
from care_sim.evaluation.recall import CENSORED_AT
from care_sim.evaluation.sightings import RANGE_M
from care_sim.reports.engine.tables import PAPER
from care_sim.reports.figures.styles import default_style, svg_text
from care_sim.reports.formatting import NOT_DETECTED
from care_sim.reports.page.episodes import Episode, episodes_to_watch, replay_episodes
from care_sim.reports.page.listing import episode_groups, replay_data
from care_sim.reports.report import read_results
from care_sim.reports.study import Study
from care_sim.reports.table import Bold, Table
from care_sim.sources.scenes import Source
from care_sim.study.executors import ExecutorFactory, processes
from care_sim.study.provenance import code_digest
from care_sim.study.results_formats import EPISODES, PLAYS, VEHICLE, is_parameter
from care_sim.study.run_config import Row

_NUMBER = re.compile(r"[≤≥~]?([+-]?\d+(?:\.\d+)?)(?=[ %*°]|$)")
_SHARE = re.compile(r"(\d+)/(\d+)")


def is_bold(text: str) -> bool:
    """Whether an entry is set in bold."""
    return isinstance(text, Bold)


def sort_key(text: str) -> float | None:
    """The number that an entry begins with, the value of a share as k/n, and the least for what was
    never detected; None for words.
    """
    # Below every distance, as medians rank it.
    if text.startswith((NOT_DETECTED, "n.d.")):
        return float("-inf")
    # k/n is a share; 0/0 is none.
    share = _SHARE.fullmatch(text)
    number = _NUMBER.match(text)
    if share and int(share[2]):
        return int(share[1]) / int(share[2])
    return float(number[1]) if number else None


CONFIG = "config.json"
_MANY = 12
"""So many values of a parameter are listed; of more, the first and the last."""
_NOT_KNOWN = "machine, versions and what was to be played are not known."


@dataclass(frozen=True)
class Provenance:
    """Origin of the rows.

    `machine` and `versions` as the study wrote them. `settings` are the values of every parameter
    that is not the same in all rows, or not the default. `missing` are sentences about what is not
    there.
    """

    machine: Mapping[str, Any]
    versions: Mapping[str, Any]
    settings: Mapping[str, str]
    missing: tuple[str, ...]

    @property
    def code(self) -> str | None:
        """Hash of the code that made the rows."""
        return self.versions.get("code")

    @property
    def code_now(self) -> str:
        """Hash of the code that makes the page."""
        return code_digest()


def provenance_of(folder: Path, rows: Sequence[Row], left_out: Sequence[str]) -> Provenance:
    """Return the origin of a study's rows, read from its folder."""
    description, trouble = description_in(folder)
    machine, versions = (
        found if isinstance(found := description.get(name), dict) else {}
        for name in ("machine", "versions")
    )
    missing = (*trouble, *(f"Left out: {what}." for what in left_out))
    return Provenance(machine, versions, settings(rows), missing)


def settings(rows: Sequence[Row]) -> dict[str, str]:
    """Parameters by name, with their values in the rows; those at their defaults throughout are
    left out.
    """
    # All rows of a file have the same columns.
    names = [*filter(is_parameter, rows[0])]
    values = {name: list(dict.fromkeys(row.get(name) for row in rows)) for name in names}
    return {name: _listed(held) for name, held in values.items() if held != [DEFAULTS.get(name)]}


def _listed(values: Sequence[Any]) -> str:
    texts = [
        "not given" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
        for value in values
    ]
    if len(texts) <= _MANY:
        return ", ".join(texts)
    return f"{texts[0]} to {texts[-1]}, {len(texts)} values"


def description_in(folder: Path) -> tuple[dict[str, Any], list[str]]:
    """The file that a study writes first of all, and what is wrong with it."""
    try:
        description = json_content(folder / CONFIG)
    except FileNotFoundError:
        return {}, [f"{CONFIG} is missing: {_NOT_KNOWN}"]
    except (OSError, ValueError) as error:
        return {}, [f"{CONFIG} cannot be read ({str(error).splitlines()[0]}): {_NOT_KNOWN}"]
    if not isinstance(description, dict):
        return {}, [f"{CONFIG} is not the description of a study: {_NOT_KNOWN}"]
    return description, []


WATCHED = (EPISODES, VEHICLE, PLAYS)
"""Kinds of results that can be played again to watch. A row of the mechanism is no play by
itself.
"""
_STYLE_ELEMENT = re.compile(r"<style.*?</style>", re.DOTALL)
_ASSETS = Path(__file__).with_name("assets")


@dataclass(frozen=True)
class Findings:
    """Findings from the rows of a study: the SVG of every figure by name, tables, sentences."""

    drawings: Mapping[str, str]
    tables: Sequence[Table]
    closing: Sequence[str]

    @classmethod
    def of(cls, study: Study, rows: Sequence[Row]) -> "Findings":
        """Figures, tables and sentences."""
        with default_style():
            figures = study.figures(rows)
        drawings = {name: svg_text(figure, name) for name, figure in figures.items()}
        tables = [table.without_empty_columns() for table in study.tables(rows)]
        return cls(drawings, tables, study.closing(rows))


@dataclass(frozen=True)
class Page:
    """Content of a study's page. `episodes` are those that were played again."""

    name: str
    study: Study
    rows: Sequence[Row]
    findings: Findings
    provenance: Provenance
    episodes: Sequence[Episode]

    def html(self) -> str:
        """The page as one file."""
        # StrictUndefined: a name that is misspelt in the template raises and is not left empty.
        environment = Environment(
            loader=FileSystemLoader(_ASSETS),
            autoescape=True,
            undefined=StrictUndefined,
            finalize=_printable,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        watched = self.study.results in WATCHED
        return environment.get_template("page.html").render(
            page=self,
            title=self.study.title,
            version=care_sim.__version__,
            drawings={name: _inline(svg) for name, svg in self.findings.drawings.items()},
            tables=self.findings.tables,
            is_bold=is_bold,
            sort_key=sort_key,
            paper=PAPER,
            reading=Markup(MarkdownIt().enable("table").render(_asset("reading.md"))),
            closing=self.findings.closing,
            watched=watched,
            open_loop=self.study.results is PLAYS,
            groups=episode_groups(self.rows, self.episodes) if watched else [],
            replays=_embedded(replay_data(self.episodes)),
            asset=_asset,
            counted=counted,
            range_m=f"{RANGE_M:g}",
            censored_at=CENSORED_AT,
        )

    @property
    def warnings(self) -> list[str]:
        """Sentences about what is missing, or is not as it was."""
        # Each reason once, with the number of episodes that it kept from playing.
        reasons = Counter(each.ending for each in self.episodes if isinstance(each.ending, str))
        unplayable = [
            f"Episodes that cannot be played again: {count} ({reason})."
            for reason, count in reasons.items()
        ]
        otherwise = [
            "Episodes that end otherwise when played again here, which are marked: "
            f"{self.differing}."
        ]
        return [*self.provenance.missing, *unplayable, *(otherwise if self.differing else [])]

    @property
    def watchable(self) -> int:
        """How many episodes were played again."""
        return sum(episode.replay is not None for episode in self.episodes)

    @property
    def identical(self) -> int:
        """How many of them fired, measured and moved as in the results."""
        return sum(episode.identical for episode in self.episodes)

    @property
    def differing(self) -> int:
        """How many of them ended otherwise."""
        return sum(bool(episode.differences) for episode in self.episodes)


def write_page(
    folder: Path,
    path: Path,
    most: int,
    workers: int,
    make_executor: ExecutorFactory = processes,
    source: Source | None = None,
) -> Page:
    """Write the page of a folder of results, with at most `most` episodes to watch, to `path`.
    `source` is where the scenes of recordings are found.

    Raises InvalidInput where there are no results and for a source of the closed loop, and
    MissingExtra without the libraries.
    """
    rows, study, left_out = read_results(folder)
    # Opened before anything is played, so that an unwritable path is reported at once.
    with replacing(path, HTML) as unfinished:
        if source is not None and study.results is not PLAYS:
            raise InvalidInput(f"--source is for plays of the open loop, and {folder} holds none")
        findings = Findings.of(study, rows)
        about = provenance_of(folder, rows, left_out)
        watched = episodes_to_watch(rows, most) if study.results in WATCHED else []
        if watched:
            rest = f" (--episodes {len(rows)}: all)" if len(watched) < len(rows) else ""
            again = counted(len(watched), "episode")
            print(f"playing {again} again to be watched{rest}", file=sys.stderr)
        episodes = replay_episodes(watched, workers, make_executor, source)
        page = Page(folder.resolve().name, study, rows, findings, about, episodes)
        unfinished.write_text(page.html(), encoding="utf-8")
    return page


def _asset(name: str) -> Markup:
    """A file of the page as it stands."""
    return Markup((_ASSETS / name).read_text(encoding="utf-8"))


def _inline(svg: str) -> Markup:
    """An SVG as an element of a page, without its head, and without its style, which is global."""
    return Markup(_STYLE_ELEMENT.sub("", svg[svg.index("<svg") :]))


def _embedded(data: Any) -> Markup:
    """Plain data for a script element."""
    text = json.dumps(_printable(data), separators=(",", ":"), ensure_ascii=False)
    # "</script>" in a text would end the element.
    return Markup(text.replace("<", "\\u003c"))


def _printable(data: Any) -> Any:
    """Plain data or a value of the template; its texts may hold anybody's names, whose control
    codes and directions are shown as escapes.
    """
    match data:
        # The page's own files.
        case Markup():
            return data
        case str():
            return printable_lines(data)
        case dict():
            return {_printable(name): _printable(value) for name, value in data.items()}
        case list() | tuple():
            return [*map(_printable, data)]
    return data
