"""Campaign: a torn or damaged journal; the same command must give the same rows, or say in one line
why not.
"""

import json
import shutil

from tests.torture import study
from tests.torture.case import DONE, REFUSED, Fault
from tests.torture.commands import run

LIMIT_S = 20.0


def prepare(_name):

    study.expected()


def play(case):
    out = case.folder / "out"
    shutil.copytree(study.undisturbed(), out)
    if case.rng.random() < 0.7:
        for path in out.iterdir():
            if path.name != study.JOURNAL:
                path.unlink()
    journal = out / study.JOURNAL
    before = journal.read_bytes()
    change = case.rng.choices(list(CHANGES), list(CHANGES.values()))[0]
    journal.write_bytes(change(case.rng, before))
    case.tell(f"{change.__name__}; the same command again")
    ended = run(study.command("out", workers=1))
    if ended == DONE:
        try:
            study.check_whole(out, once=False)
        except Fault as fault:
            fault.place = change.__name__
            raise
    elif ended == REFUSED and change in (
        cut,
        lines_doubled,
        lines_lost,
        lines_swapped,
        zeros_after_a_crash,
        blank_lines,
    ):
        raise Fault("a torn journal that keeps the study from going on", "", change.__name__)
    return ended


def cut(rng, data):
    return data[: rng.randrange(len(data) + 1)]


def bits_flipped(rng, data):
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 10))):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(data)


def digits_changed(rng, data):
    """As a bit of a digit flips: the line stays JSON."""
    data = bytearray(data)
    places = [at for at, byte in enumerate(data) if chr(byte).isdigit()]
    for _ in range(rng.choice((1, 1, 3))):
        data[rng.choice(places)] = ord(rng.choice("0123456789"))
    return bytes(data)


def keys_changed(rng, data):
    lines = data.decode().splitlines()
    at = rng.randrange(len(lines))
    row = json.loads(lines[at])
    row[rng.choice(("x", "wall_s ", ""))] = row.pop(rng.choice(list(row)))
    lines[at] = json.dumps(row)
    return ("\n".join(lines) + "\n").encode()


def digests_swapped(rng, data):
    lines = data.decode().splitlines()
    one, other = rng.sample(range(len(lines)), 2)
    a, b = json.loads(lines[one]), json.loads(lines[other])
    a["digest"], b["digest"] = b["digest"], a["digest"]
    lines[one], lines[other] = json.dumps(a), json.dumps(b)
    return ("\n".join(lines) + "\n").encode()


def lines_doubled(rng, data):
    lines = data.splitlines(keepends=True)
    return b"".join(line for line in lines for _ in range(rng.choice((1, 1, 2, 3))))


def lines_lost(rng, data):
    return b"".join(line for line in data.splitlines(keepends=True) if rng.random() < 0.7)


def lines_swapped(rng, data):
    lines = data.splitlines(keepends=True)
    rng.shuffle(lines)
    return b"".join(lines)


def blank_lines(rng, data):
    return b"".join(
        line + rng.choice((b"", b"", b"\n", b" \n", b"\r\n"))
        for line in data.splitlines(keepends=True)
    )


def zeros_after_a_crash(rng, data):
    """What some file systems leave when the power fails: the length is right, the last block is
    zeros.
    """
    at = rng.randrange(len(data))
    return data[:at] + bytes(rng.choice((len(data) - at, 512)))


ODD_LINES = (
    b"null",
    b"[]",
    b"{}",
    b'{"digest": 5}',
    b'{"digest": []}',
    b'{"digest": "x"}',
    b"NaN",
    b"[" * 100_000,
    b"\xff\xfe",
    b'{"digest": {"a": 1}}',
    b"1e999",
    b"9" * 5000,
)


def foreign_lines(rng, data):
    odd = rng.choice(ODD_LINES) + b"\n"
    lines = data.splitlines(keepends=True)
    lines.insert(rng.randrange(len(lines) + 1), odd)
    return b"".join(lines)


def glued(rng, data):
    """Two lines without the end of the first."""
    ends = [at for at, byte in enumerate(data) if byte == 10]
    at = rng.choice(ends)
    return data[:at] + data[at + 1 :]


CHANGES = {
    cut: 4,
    bits_flipped: 6,
    digits_changed: 5,
    keys_changed: 2,
    digests_swapped: 1,
    lines_doubled: 2,
    lines_lost: 2,
    lines_swapped: 1,
    blank_lines: 1,
    zeros_after_a_crash: 2,
    foreign_lines: 3,
    glued: 2,
}
