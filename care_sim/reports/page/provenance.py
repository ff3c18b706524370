"""Where the rows of a page come from: machine, versions, code, configuration, and what of it is
missing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from care_sim.base.files import json_content
from care_sim.core.conditions import DEFAULTS
from care_sim.study.provenance import code_digest
from care_sim.study.results_formats import is_parameter
from care_sim.study.run_config import Row

CONFIG = "config.json"
_MANY = 12
"""So many values of a parameter are listed; of more, the first and the last."""
_NOT_KNOWN = "machine, versions and what was to be played are not known."


@dataclass(frozen=True)
class Provenance:
    """What is known of where rows come from.

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
    """What the folder of a study tells about its rows."""
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
