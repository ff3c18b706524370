"""Hyperparameters in files: a TOML table per environment, as in RL Zoo. Shipped files are in
`recipes`, one per learner.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from care_sim.base.checks import check_arguments, check_path, is_number
from care_sim.base.errors import InvalidInput, shown
from care_sim.base.plugins import scenario_of
from care_sim.training.config import HOW_LONG, AgentConfig

DEFAULT = "default"
"""The table of every environment without its own one."""
DRAWN = "drawn"
"""The table of drawn episodes, for any environments."""
_NOT_OF_A_FILE = {*HOW_LONG, "env", "seed", "drawn", "without"} - {"steps"}
"""Fields of a configuration that belong to one run, one machine, or the environments."""


@dataclass(frozen=True)
class Hyperparameters:
    """The values of a table and its place: the file, and the table's name, None if the file has no
    table for the environment.
    """

    values: Mapping[str, Any]
    path: Path
    table: str | None

    def told(self, config: AgentConfig) -> str:
        """Return the effective values, options included, in a line."""
        if self.table is None:
            return f"hyperparameters: {self.path.name} has none for {' '.join(config.env)}"
        listed = ", ".join(f"{name} {getattr(config, name)}" for name in self.values)
        return f"hyperparameters of {self.path} [{self.table}], options included: {listed}"


def shipped_file(algorithm: str) -> Path:
    """Return the shipped file."""
    return Path(__file__).parent / "recipes" / f"{algorithm}.toml"


def names_of(kind: type[AgentConfig]) -> list[str]:
    """Return the hyperparameters that a file may hold for a learner."""
    return [field.name for field in fields(kind) if field.name not in _NOT_OF_A_FILE]


def read_hyperparameters(
    kind: type[AgentConfig], envs: Sequence[str], path: Path | None = None, drawn: bool = False
) -> Hyperparameters:
    """Read the hyperparameters of a learner in an environment from the file at `path`, by default
    from the shipped one. Episodes that are `drawn` use the table DRAWN if it exists; otherwise
    several environments use DEFAULT. The reward of drawn episodes has no term for `gain`, which
    then has no effect.

    Raises InvalidInput for a file that is missing, damaged or has another form. Also raises it for
    an unknown hyperparameter, and for a value that the learner does not take.
    """
    path = shipped_file(kind.algorithm) if path is None else path
    tables = _tables(path)
    # An environment has one table, named by its id or by its scenario.
    asked = {scenario_of(env) for env in envs}
    named = [name for name in tables if name not in (DEFAULT, DRAWN)]
    found = [*([DRAWN] if drawn else []), *(one for one in named if asked == {scenario_of(one)})]
    table = next((name for name in [*found, DEFAULT] if name in tables), None)
    if table is None:
        return Hyperparameters({}, path, None)
    where = f"{path} [{table}]"
    check_arguments(where, tables[table], names_of(kind))
    values = {name: _settled(kind, where, name, value) for name, value in tables[table].items()}
    if drawn:
        values.pop("gain", None)
    try:
        # Checked in the environments, since an env_parameter may belong to one of them.
        kind(**values, env=tuple(envs), drawn=drawn or len(envs) > 1)
    except InvalidInput as error:
        raise InvalidInput(f"{where}: {error}") from error
    return Hyperparameters(values, path, table)


def _tables(path: Path) -> dict[str, dict[str, Any]]:
    check_path("hyperparameters", path)
    if not path.is_file():
        raise InvalidInput(f"hyperparameters {path}: no such file")
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    # Tables within tables without end are an error of recursion.
    except (ValueError, RecursionError) as error:
        raise InvalidInput(f"hyperparameters {path} is no TOML file: {error}") from error
    for name, table in tables.items():
        if not isinstance(table, dict):
            raise InvalidInput(
                f"hyperparameters {path}: {name} stands in no table; a file holds one for every "
                f'environment, such as ["CARE-Dense-v0"] or [{DEFAULT}]'
            )
    return tables


def _settled(kind: type[AgentConfig], where: str, name: str, value: Any) -> Any:
    """Return a value as the field holds it. The configuration checks values that are not lists."""
    default = next(field.default for field in fields(kind) if field.name == name)
    if not isinstance(default, tuple):
        return value
    is_one = is_number if name == "budget" else lambda one: isinstance(one, str)
    if not (isinstance(value, list) and all(map(is_one, value))):
        wanted = "numbers" if name == "budget" else "texts NAME=VALUE"
        raise InvalidInput(f"{where}: {name} must be a list of {wanted}, got {shown(value)}")
    return tuple(value)
