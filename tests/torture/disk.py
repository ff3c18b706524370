"""Campaign: the disk is full in the midst of writing.

A case of an even number writes on a small file system in memory, where the user may mount one; all
others, and where he may not, under a limit on the size of a file, which the operating system
reports in the same place of the same calls.
"""

import os
import shutil
import subprocess
from contextlib import contextmanager

from tests.torture import judge, props, study
from tests.torture.case import DONE, Fault
from tests.torture.processes import Command
from tests.torture.writers import check_file

LIMIT_S = 240.0
ENDS_WITHIN_S = 20.0
SPACE = ("No space left on device", "File too large")


def prepare(_name):
    study.expected()
    for name in ("results", "drive"):
        props.template(name)


def play(case):
    kind = case.rng.choices(list(WRITERS), list(WRITERS.values()))[0]
    line, product = WRITER_LINES[kind]
    size = case.rng.choice((0, 1, 100, 4096, 2**15, 2**17, case.rng.randrange(1, 2**19)))
    mounted = case.name.number % 2 == 0 and may_mount()
    case.tell(
        f"care-sim {' '.join(line)}, room for {size} bytes "
        f"{'on the disk' if mounted else 'in a file'}"
    )
    with _small(case.folder, mounted) as folder:
        props.lay_out({"results"} & set(line), folder)
        before = {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        ballast = _fill(folder, size) if mounted else None
        ended = _run_out(case, line, folder, None if mounted else size)
        if ended != DONE:
            _check_left(folder, product, before)
        if ballast:
            ballast.unlink()
        _run_again(line, folder, product)
    return ended


def _run_out(case, line, folder, file_bytes):
    """The command as the space runs out; how it ended."""
    with Command(line, folder, file_bytes) as command:
        code = command.wait(ENDS_WITHIN_S)
        out, err = command.said()
        case.tell(f"ended with {code}: {err.strip()[-200:]!r}")
        command.check_gone()
        ended = judge.ending(code, out, err, command.arguments)
    if ended == DONE:
        product = folder / WRITER_LINES_BY_LINE[tuple(line)]
        if product.exists() and product.is_file():
            check_product(product)
    # A report prints its tables all the same, and ends with 1.
    elif code not in (1, 2) or not any(reason in err for reason in SPACE):
        raise Fault("a full disk that is not said", f"{code} {err}")
    return ended


def _check_left(folder, product, before):
    """What was there is there; what is new is whole or absent."""
    for name, content in before.items():
        found = [path for path in folder.rglob(name) if path.is_file()]
        if not any(path.read_bytes() == content for path in found) and name not in REMADE:
            raise Fault("a file lost for want of space", name, name)
    path = folder / product
    if path.is_file():
        check_product(path)
    if path.is_dir() and (path / study.JOURNAL).exists():
        study.check_not_torn(path)


def check_product(path):
    if path.suffix == ".npz":
        from care_sim.policies.learned.weights import load_weights

        load_weights(path)
    elif path.suffix == ".parquet":
        study.steady(path.parent)
    else:
        check_file(path)


def _run_again(line, folder, product):
    """With space it does what it was told."""
    if line[0] == "run" and "--export" in line:
        shutil.rmtree(folder / product, ignore_errors=True)
    with Command(line, folder) as command:
        code = command.wait(60)
        out, err = command.said()
        if judge.ending(code, out, err, command.arguments) != DONE:
            raise Fault("does not go on when there is space again", err)
    if line[0] == "sweep":
        study.check_whole(folder / product)
    elif (folder / product).is_file():
        check_product(folder / product)


@contextmanager
def _small(folder, mounted):
    place = folder / "small"
    place.mkdir()
    if not mounted:
        yield place
        return
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(place)], check=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


def may_mount():
    """Whether this user may mount a small file system."""
    if os.geteuid() or not shutil.which("mount"):
        return False
    place = props._templates() / "mountable"
    place.mkdir(exist_ok=True)
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(place)], capture_output=True
    ).returncode:
        return False
    subprocess.run(["umount", str(place)], check=True)
    return True


def _fill(folder, room):
    """A file that leaves so many bytes, by whole pages."""
    state = os.statvfs(folder)
    size = max(0, state.f_bavail * state.f_bsize - room)
    ballast = folder.parent / "small" / "ballast"
    with ballast.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, max(1, size))
    return ballast


SHORT = ("--scenario-parameters", "duration_s=0.6")
WRITER_LINES = {
    "study": (study.command("out", workers=1), "out"),
    "picture": (["run", "dartout", "--picture", "x.png", "--seed", "0"], "x.png"),
    "gif": (["run", "dartout", "--video", "x.gif", *SHORT], "x.gif"),
    "png": (["run", "dartout", "--video", "x.png", *SHORT], "x.png"),
    "film": (["run", "dartout", "--video", "x.mp4", *SHORT], "x.mp4"),
    "recording": (["run", "dartout", "--record", "x.rrd", *SHORT], "x.rrd"),
    "compared": (["compare", "dartout", "--record", "x.rrd", "--video", "x.webp", *SHORT], "x.rrd"),
    "scans": (["run", "dartout", "--export", "scans", *SHORT], "scans"),
    "page": (["report", "results", "-o", "x.html", "--episodes", "0"], "x.html"),
    "report": (["report", "results"], "results/episodes.parquet"),
}
WRITER_LINES_BY_LINE = {tuple(line): product for line, product in WRITER_LINES.values()}
WRITERS = {
    "study": 4,
    "picture": 1,
    "gif": 1,
    "png": 1,
    "film": 2,
    "recording": 2,
    "compared": 2,
    "scans": 2,
    "page": 2,
    "report": 1,
}
REMADE = {"tables.md", "tables.tex", "ballast"}
"""Files that a report makes again."""
