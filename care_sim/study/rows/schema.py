"""Schema of the columns of results, which every report relies on. Columns are checked when a file
is opened.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import pyarrow as pa
import pyarrow.compute as pc

from care_sim.core.conditions import DEFAULTS

_LARGEST = 1e12
"""The largest size of a measured number that can still be averaged and drawn."""
PARAMETERS = ("scenario.", "policy.", "detector.")
"""Prefixes of parameter columns."""


def _is_text(kind: pa.DataType) -> bool:
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def _is_number(kind: pa.DataType) -> bool:
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))


def _is_list_of(is_kind: Callable[[pa.DataType], bool], kind: pa.DataType) -> bool:
    is_list = pa.types.is_list(kind) or pa.types.is_large_list(kind)
    return is_list and (pa.types.is_null(kind.value_type) or is_kind(kind.value_type))


def _is_parameter(kind: pa.DataType) -> bool:
    return (
        _is_text(kind)
        or _is_number(kind)
        or pa.types.is_boolean(kind)
        or _is_list_of(_is_parameter, kind)
    )


_ANY = "text, numbers, flags or lists of them"
_KINDS: dict[str, Callable[[pa.DataType], bool]] = {
    "text": _is_text,
    "true or false": pa.types.is_boolean,
    "whole numbers": pa.types.is_integer,
    "numbers": _is_number,
    "lists of whole numbers": lambda kind: _is_list_of(pa.types.is_integer, kind),
    "lists of texts": lambda kind: _is_list_of(_is_text, kind),
    _ANY: _is_parameter,
}
_WRITTEN = {"text": pa.string(), "true or false": pa.bool_(), "whole numbers": pa.int64()}


@dataclass(frozen=True)
class Column:
    """A column of one of `_KINDS`, its numbers between `least` and `most`.

    An `optional` column may be empty in rows. `whole` numbers may have any type in a file.
    """

    kind: str
    optional: bool = False
    least: float = -_LARGEST
    most: float = _LARGEST
    whole: bool = False

    @property
    def type(self) -> pa.DataType:
        """The type to write where no row holds a value."""
        return _WRITTEN.get(self.kind, pa.float64())

    def faults(self, values: pa.ChunkedArray) -> Iterator[str]:
        """Yield the faults of a file's values."""
        if self.optional and values.null_count == len(values):
            # The type of an empty column has no meaning: pandas and earlier versions write numbers
            # there.
            return
        if not _KINDS[self.kind](values.type):
            yield f"must hold {self.kind}, got {values.type}"
        elif values.null_count and not self.optional:
            yield f"must hold {self.kind} in every row, got nothing in {values.null_count}"
        else:
            yield from self._beyond(values)

    def _beyond(self, values: pa.ChunkedArray) -> Iterator[str]:
        # Lists within lists are opened level by level; a gap in one is no number.
        while _is_list_of(lambda _kind: True, values.type):
            values = pc.list_flatten(values)
            if values.null_count:
                yield "must hold whole lists, got lists with gaps"
        if not _is_number(values.type) or self.kind == _ANY:
            return
        # Without any number, as in empty lists, the ends and `finite` are None.
        ends = pc.min_max(values).as_py()
        lowest = ends["min"]
        highest = ends["max"]
        finite = pc.all(pc.is_finite(values)).as_py()
        if lowest is None:
            return
        if not (finite and self.least <= lowest and highest <= self.most):
            yield f"must hold {self.kind} from {self.least:g} to {self.most:g}"
        elif self.whole and pc.all(pc.equal(pc.round(values), values)).as_py() is False:
            yield "must hold whole numbers"


TEXT = Column("text")
FLAG = Column("true or false")
COUNT = Column("whole numbers", least=0)
SEED = Column("whole numbers", least=0, most=math.inf)
MEASURE = Column("numbers")
"""Numbers that may be below 0, such as the distance of overlapping hulls."""
SUM = Column("numbers", least=0)
TALLY = Column("numbers", least=0, whole=True)
"""Counts of events and frames: numerators and denominators of the ratios in tables."""
SHARE = Column("numbers", least=1e-9, most=1)
PARAMETER = Column(_ANY, optional=True)
_OF_TYPES = {
    bool: "true or false",
    int: "whole numbers",
    float: "numbers",
    str: "text",
    tuple: "lists of whole numbers",
}
CONDITION_COLUMNS = {
    name: Column(_OF_TYPES[type(value)], optional=True) for name, value in DEFAULTS.items()
}


def as_optional(column: Column) -> Column:
    """Return the columns as optional ones."""
    return replace(column, optional=True)


@dataclass(frozen=True)
class Schema:
    """The columns of a kind of results.

    `needed` columns are required; `further` ones are checked if present. `sums` repeat for every
    stratum as KIND/STRATUM/NAME, all of them or none. Columns of parameters are also known. All
    others are ignored. A number in a column of `parts` is at most the number in the column that it
    names, also in every stratum.
    """

    needed: Mapping[str, Column] = field(default_factory=dict)
    further: Mapping[str, Column] = field(default_factory=dict)
    sums: tuple[str, ...] = ()
    parts: Mapping[str, str] = field(default_factory=dict)

    def faults(self, table: pa.Table) -> Iterator[str]:
        """Yield the faults of a table."""
        names = table.column_names
        if missing := sorted({*self.needed, *self._strata(names)} - {*names}):
            yield f"it lacks {', '.join(missing)}"
        elif not table.num_rows:
            yield "it is empty"
        else:
            for name in self.known(names):
                yield from (
                    f"its column {name} {fault}" for fault in self.column(name).faults(table[name])
                )
            yield from self._exceeding(table)

    def known(self, names: Sequence[str]) -> list[str]:
        """The columns that are read."""
        known = {*self.needed, *self.further, *self._strata(names)}
        return [name for name in names if name in known or name.startswith(PARAMETERS)]

    def _exceeding(self, table: pa.Table) -> Iterator[str]:
        for name in table.column_names:
            stratum, slash, last = name.rpartition("/")
            whole = f"{stratum}{slash}{self.parts.get(last)}"
            if (
                whole in table.column_names
                and pc.any(pc.greater(table[name], table[whole])).as_py()
            ):
                yield f"its column {name} must be at most {whole} in every row"

    @property
    def lenient(self) -> "Schema":
        """Return the schema without required columns, for results of an older version."""
        return Schema({}, {**self.needed, **self.further})

    def column(self, name: str) -> Column:
        """Return the rule for a column, by default that of a stratum's sum."""
        if name.startswith(PARAMETERS):
            return {**self.further, **self.needed}.get(name, PARAMETER)
        return {**self.further, **self.needed}.get(name, TALLY)

    def _strata(self, names: Sequence[str]) -> set[str]:
        """Return all columns of the strata that have at least one."""
        parts = (name.split("/") for name in names)
        strata = {
            (kind, label)
            # A file that has one sum of a stratum must have all of them.
            for kind, label, last in (part for part in parts if len(part) == 3)
            if last in self.sums
        }
        return {f"{kind}/{label}/{name}" for kind, label in strata for name in self.sums}
