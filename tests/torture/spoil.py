"""Ways in which a file may be damaged, changed, or not be what it says."""

import json
from contextlib import suppress

import numpy as np

from tests.torture.case import words

DEEP = 100_000
PLAIN = [
    *(None, True, 0, -1, 1, 0.5, 1e308, -1e308, 10**22, 2**63, float("nan"), float("inf"), 5e-324),
    *("", "x", "care", "\ud800", "\x00", "\x1b[31m", "x" * 100_000, "<script>", "$x_1$", "2**9"),
    *([], {}, [[]], [1, 2], {"a": 1}, [None], [[1, [2]]]),
]
"""Values that may be in JSON where something else belongs."""


ODD_BYTES = (
    b"\0",
    b"\xff\xfe",
    b"[" * 1000,
    b"9" * 400,
    b"\n",
    b'"',
    b"\r\n",
    b"NaN",
    b"\x9d" * 64,
)


def raw(rng, path, others=()):
    """Damage bytes; `others` are files whose content may take the place of this one's. Says what
    was done.
    """
    data = path.read_bytes()
    at = rng.randrange(len(data) + 1)
    end = min(len(data), at + rng.choice((8, 512, 4096)))
    name = rng.choices([*RAW], [share for share, _ in RAW.values()])[0]
    if name == "another" and others:
        path.write_bytes(rng.choice(others).read_bytes())
    else:
        path.write_bytes(RAW[name][1](rng, data, at, end))
    return name


def _flipped(rng, data, *_):
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 3, 30)) if data else 0):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return data


def _blank(rng, data, at, end):
    return data[:at] + rng.choice((b"\0", b"\xff", b" ", b"9")) * (end - at) + data[end:]


def _repeated(rng, data, at, end):
    return data[:end] + data[at:end] * rng.choice((1, 1, 50)) + data[end:]


def _deep(rng, *_):
    return rng.choice((b"[" * DEEP, b'{"a":' * DEEP, b"[" * DEEP + b"]" * DEEP))


RAW = {
    "bits": (6, _flipped),
    "cut": (3, lambda rng, data, at, end: data[:at]),
    "front cut": (1, lambda rng, data, at, end: data[at:]),
    "blank": (2, _blank),
    "inserted": (2, lambda rng, data, at, end: data[:at] + rng.choice(ODD_BYTES) + data[at:]),
    "repeated": (2, _repeated),
    "another": (1, lambda rng, data, at, end: data),
    "empty": (1, lambda rng, data, at, end: b""),
    "deep": (1, _deep),
    "noise": (1, lambda rng, data, at, end: rng.randbytes(min(len(data), 5000))),
}
"""How often bytes are damaged in a way, and how: from the byte `at` on, or up to `end`."""


def instead(rng, path):
    """Put something that is no file in its place."""
    path.unlink()
    change = rng.choice([*INSTEAD])
    INSTEAD[change](path)
    return change


INSTEAD = {
    "folder": lambda path: path.mkdir(),
    "gone": lambda path: None,
    "loop": lambda path: path.symlink_to(path.name),
    "zeros": lambda path: path.symlink_to("/dev/zero"),
    "locked": lambda path: path.touch(0),
}


def json_node(rng, path):
    """Change one node of a JSON file, somewhere in it."""
    tree = json.loads(path.read_text())
    told = _change_node(rng, tree)
    path.write_text(json.dumps(tree))
    return told


def _change_node(rng, tree):
    holder, key = None, None
    node = tree
    while isinstance(node, dict | list) and node and (holder is None or rng.random() < 0.85):
        holder = node
        key = rng.choice(list(node)) if isinstance(node, dict) else rng.randrange(len(node))
        node = node[key]
    if holder is None:
        return "nothing to change"
    change = rng.randrange(6)
    if change == 0:
        del holder[key]
        return f"{key!r} gone"
    if change == 1:
        if isinstance(holder, dict):
            holder["surplus"] = rng.choice(PLAIN)
        else:
            holder.append(holder[key])
        return f"one too many beside {key!r}"
    holder[key] = rng.choice(PLAIN)
    return f"{key!r} is {ascii(holder[key])[:80]}"


def json_lines_node(rng, path):
    """The same in a line of a file of JSON lines."""
    lines = path.read_text().splitlines()
    at = rng.randrange(len(lines))
    tree = json.loads(lines[at])
    told = _change_node(rng, tree)
    lines[at] = json.dumps(tree)
    path.write_text("\n".join(lines) + "\n")
    return f"line {at}: {told}"


def table(rng, read, write):
    """Change a column of an Arrow table or its rows; `read` gives it, `write` takes it."""
    import pyarrow as pa

    whole = read()
    name = rng.choice(whole.column_names)
    at = whole.column_names.index(name)
    change = rng.choice(words("drop rename value value value empty rows double type notes"))
    if change == "drop":
        whole = whole.drop_columns([name])
    elif change == "rename":
        names = [*whole.column_names]
        names[at] = rng.choice(("x", "", "\x1b[31m", "seed"))
        whole = whole.rename_columns(names)
    elif change == "empty":
        whole = whole.slice(0, 0)
    elif change == "rows":
        whole = whole.take(rng.choices(range(len(whole)), k=rng.randrange(1, 5)))
    elif change == "double":
        whole = pa.concat_tables([whole, whole])
    elif change == "notes":
        odd = (b"", b"x", b"\xff", b"[", b"[1", b"[[", b"{}", b"5", b"[null]", b"[[[1]]]")
        notes = {key: rng.choice(odd) for key in whole.schema.metadata or {b"a": b""}}
        whole, change = whole.replace_schema_metadata(notes), f"notes {notes}"
    else:
        values = _other_column(rng, whole.column(at).to_pylist(), change == "type")
        whole = whole.set_column(at, name, values)
        change = f"{change} {values.type} {ascii(values[0].as_py())[:60]}"
    write(whole)
    return f"column {name!r}: {change}"


ODD_CELLS = [
    *(None, float("nan"), float("inf"), -1, 0, 1e308, 2**62, -(2**62), "x", "", "\x1b[31m"),
    *("$x_1$", b"\xff", [1], [], {"a": 1}, True, 5e-324),
]


def _other_column(rng, values, every):
    """A column with one value that does not belong, or of another kind from top to bottom."""
    import pyarrow as pa

    odd = rng.choice(ODD_CELLS)
    if not every and values:
        values[rng.randrange(len(values))] = odd
        with suppress(pa.ArrowException, OverflowError, TypeError, ValueError):
            return pa.array(values)
    return pa.array([odd] * len(values))


def weights(rng, path):
    """Change the card or an array in an archive of weights."""
    with np.load(path) as file:
        entries = {name: file[name] for name in file.files}
    name = rng.choice(["card"] * len(entries) + [*entries])
    if name == "card":
        card = json.loads(bytes(entries["card"]).decode())
        told = _change_node(rng, card)
        entries["card"] = np.frombuffer(json.dumps(card).encode(), np.uint8)
    else:
        array, told = entries.pop(name), name
        kind = rng.choice((np.float64, np.int8, complex, object, "U4"))
        odd = [array.astype(kind), array[..., None], array.ravel()[:3]]
        if array.dtype.kind == "f":
            odd += [np.full_like(array, value) for value in (np.nan, np.inf, 3e38, -3e38)]
        if rng.random() < 0.8:
            entries[name] = rng.choice(odd)
    with open(path, "wb") as file:
        np.savez(file, **entries)
    return told


def csv(rng, path):
    """Change a cell, a line or the heading of a CSV file."""
    rows = [line.split(",") for line in path.read_text().splitlines()]
    row = rng.randrange(len(rows))
    change = rng.randrange(4)
    if change == 0:
        del rows[row]
    elif change == 1:
        rows.append(rows[row])
    else:
        rows[row][rng.randrange(len(rows[row]))] = rng.choice(
            ("", "x", "nan", "inf", "-1", "1e999", "9" * 400, '"', "0")
        )
    path.write_text("\n".join(",".join(row) for row in rows) + "\n")
    return f"row {row}: {change}"


def points(rng, path):
    """Change numbers of a binary sweep."""
    values = np.frombuffer(path.read_bytes(), np.float32).copy()
    values[rng.randrange(len(values))] = rng.choice((np.nan, np.inf, -np.inf, 1e30, -1e30, 0))
    path.write_bytes(values.tobytes() * rng.choice((1, 1, 2)) + b"\0" * rng.choice((0, 0, 1, 4)))
    return "numbers"
