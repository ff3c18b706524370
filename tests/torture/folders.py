"""Campaign: odd places for what commands write: links, names, folders and files that are no files.

Beside the working folder lie canaries, a file and a folder, to which planted links lead. Nothing
but what the command names may change.
"""

import os
import stat
from pathlib import Path

from tests.torture import commands, props
from tests.torture.case import Fault, words

LIMIT_S = 20.0
SHORT = ("--scenario-parameters", "duration_s=0.2")
SWEEP = ("sweep", "--scenarios", "dartout", "--policies", "history", "--seeds", "1")
FILES = {
    ".png": ("run", "dartout", "--at", "0", *SHORT, "--picture"),
    ".gif": ("run", "dartout", *SHORT, "--video"),
    ".rrd": ("run", "dartout", *SHORT, "--record"),
    ".html": ("report", "../results", "--episodes", "0", "-o"),
}
FOLDERS = (
    (*SWEEP, "--workers", "1", *SHORT, "--force", "--out"),
    ("report", "../results", "../results", "--out"),
    ("run", "dartout", *SHORT, "--export"),
)
OUTPUTS = words(
    "journal.jsonl config.json episodes.parquet tables.md tables.tex unfinished.json "
    "episode.json 000.pcd"
)
"""Names of files in a folder of results, under which links and other things are planted."""
SYSTEM = ("/dev/null", "/dev/full", "/proc", "/proc/self/nothing", "/proc/version", "/dev/null/x")


def prepare(_name):
    commands.warm_up()
    props.template("results")


def play(case):
    rng = case.rng
    folder = rng.random() < 0.6
    if folder:
        line, ending = rng.choice(FOLDERS), ""
    else:
        ending, line = rng.choice([*FILES.items()])
    if "../results" in line:
        props.copy("results", case.folder / "results")
    outside, here = case.folder / "outside", case.folder / _working_name(rng)
    (outside / "far").mkdir(parents=True)
    (outside / "theirs").write_text("theirs\n")
    here.mkdir(parents=True)
    os.chdir(here)
    named = rng.choice(SYSTEM) if rng.random() < 0.1 else _name(rng) + ending
    if not named.startswith("/"):
        case.tell(_lay_out(rng, here / named, folder))
    case.tell(f"care-sim {' '.join(line)} {ascii(named)[:200]} in {ascii(here.name)[:60]}")
    leads_out = folder and os.path.realpath(named).startswith(str(outside / "far"))
    before = _seen(outside)
    try:
        return commands.run((*line, named))
    finally:
        after = _seen(outside)
        if leads_out:
            after = {path: kept for path, kept in after.items() if path in before}
        if after != before:
            raise Fault("a changed file outside the named folder", f"{before} -> {after}")
        left = [path.name for path in Path().rglob(".*.*") if f".{os.getpid()}." in path.name]
        if left:
            raise Fault("an unfinished file is left", str(left))


def _seen(folder):
    """The files of a folder, with content, rights and links as they are."""
    return {
        str(path): (
            path.lstat().st_mode,
            os.readlink(path) if path.is_symlink() else path.is_file() and path.read_bytes(),
        )
        for path in folder.rglob("*")
    }


def _working_name(rng):
    return rng.choice(("here", "here", "with space", os.fsdecode(b"w\xfc"), "w" * 200, "{a}'\"$x"))


def _name(rng):
    """The name of an output, plain or odd; a path near the longest there is among them."""
    long = ("n" * rng.randrange(240, 260), "ä" * rng.randrange(118, 130))
    deep = "/".join(["d" * 200] * rng.randrange(15, 22))
    plain = words("out out out out deep/er/out ~ $HOME x=1 [a]*? .. . ../here-too")
    return rng.choice((*plain, *long, deep, os.fsdecode(b"z\xfc"), "a b", "a\nb"))


def _lay_out(rng, target, folder):
    """Put something where the command will write; what it is."""
    try:
        if folder and rng.random() < 0.6:
            target.mkdir(parents=True)
            return f"in the folder {_odd(rng, target / rng.choice(OUTPUTS))}"
        target.parent.mkdir(parents=True, exist_ok=True)
        return _odd(rng, target)
    except OSError as error:  # the name is too long, or there already
        return f"nothing: {error.strerror}"


def _odd(rng, path):
    """Make something odd, or nothing, of a name; what it is."""
    outside = next(p for p in path.parents if (p / "outside").is_dir()) / "outside"
    kind = rng.choice([*KINDS])
    KINDS[kind](path, outside)
    return f"{ascii(path.name)[:60]}: {kind}"


def _file(mode, owner=0):
    def make(path, _outside):
        path.write_bytes(b"")
        _give(path, owner, mode)

    return make


def _folder(mode, owner=0):
    def make(path, _outside):
        path.mkdir()
        (path / "config.json").touch()
        _give(path / "config.json", 12345, 0o644)
        _give(path, owner, mode)

    return make


def _give(path, owner, mode):
    path.chmod(mode)
    if not os.geteuid():
        os.chown(path, owner, owner)


def _fixed(link):
    return lambda path, _outside: path.symlink_to(link)


KINDS = {
    "nothing": lambda path, outside: None,
    "a link to a file": lambda path, outside: path.symlink_to(outside / "theirs"),
    "a link to nothing": lambda path, outside: path.symlink_to(outside / "new"),
    "a link to nothing in a folder": lambda path, outside: path.symlink_to(outside / "no" / "new"),
    "a link to a folder": lambda path, outside: path.symlink_to(outside / "far"),
    "a hard link": lambda path, outside: os.link(outside / "theirs", path),
    "a link to itself": lambda path, outside: path.symlink_to(path.name),
    "a link to a device": _fixed("/dev/null"),
    "a link to a full device": _fixed("/dev/full"),
    "a link to the output": _fixed("/dev/stdout"),
    "a pipe": lambda path, outside: os.mkfifo(path),
    "a device": lambda path, outside: os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, 3)),
    "a file": _file(0o644),
    "a file that may not be written": _file(0o400),
    "a file of somebody else": _file(0o600, 12345),
    "a folder": _folder(0o755),
    "a folder that may not be written": _folder(0o500),
    "a folder of somebody else": _folder(0o755, 12345),
    "a sticky folder": _folder(0o1777, 12345),
}
"""Things that may be at the path of an output."""
