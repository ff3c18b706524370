"""Play published studies again with the code of today, and replace their rows: `make publish`.

Every folder of `results/data` is played by the command in its `config.json`, and `b90` by
`docs/b90_results.py`, in a folder per code and study below `--work`. A study keeps a journal there,
so the same line resumes after an interrupt. A folder that the code of today has played stays.
"""

import argparse
import json
import os
import re
import shlex
import subprocess
import sys
import time
from collections import Counter
from difflib import SequenceMatcher
from pathlib import Path

from pyarrow.parquet import read_table

from care_sim.base.files import replacing
from care_sim.base.limits import WORKERS
from care_sim.study.provenance import code_digest
from tests.golden.published import cells_of, folders, read_golden, write_golden
from tests.helpers.places import EXAMPLES, PUBLISHED, ROOT, loaded

CONFIG, TABLES = "config.json", "tables.md"
ROWS = ("episodes.parquet", "plays.parquet", "vehicle.parquet")
RECORDINGS = {
    "argoverse2": "argoverse2",
    "kitti": "kitti-tracking",
    "nuscenes": "nuscenes-mini",
}
"""Folders below `--data` that stand for FOLDER in a command, by the kind of their recordings."""
KEPT = {"compute-path.json"}
"""Published files that no command makes any longer."""
SHOWN = 60
"""Changed lines of tables that are printed."""


def main(arguments=None):
    """Publish folders; 1 where one of them was not published."""
    parser = argparse.ArgumentParser(prog="make publish", description=__doc__.partition("\n")[0])
    parser.add_argument(
        "folders", nargs="*", help="of results/data, in this order; else all but b90"
    )
    parser.add_argument("--data", type=Path, help="holds the recordings: " + str(RECORDINGS))
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "publish")
    parser.add_argument("--workers", type=int, default=WORKERS)
    parser.add_argument("--list", action="store_true", help="print order and costs, play nothing")
    given = parser.parse_args(arguments)
    code = code_digest()
    refused = 0
    for folder in map(PUBLISHED.joinpath, given.folders) if given.folders else by_cost():
        made = given.work.resolve() / code / folder.name
        if not folder.is_dir():
            parser.error(f"results/data has no folder {folder.name}")
        if folder.name == "b90" and given.list:
            print("b90: see docs/b90_results.py")
        elif folder.name == "b90":
            refused |= b90_anew(made, given.data, given.workers)
        elif json.loads((folder / CONFIG).read_text())["versions"]["code"] == code:
            print(f"{folder.name}: published with this code")
        elif given.list:
            print(f"{folder.name}: {len(rows(folder)):,} rows, {seconds(folder) / 60:.1f} minutes")
        else:
            fault = played(folder, made, given.data, given.workers) or published(folder, made)
            refused |= bool(fault)
            print(fault or f"{folder.name}: published", flush=True)
    return refused


def by_cost():
    """The folders of studies, the cheapest first."""
    return sorted((path.parent for path in PUBLISHED.glob(f"*/{CONFIG}")), key=seconds)


def seconds(folder):
    """Seconds that its plays took when they were published, on one core."""
    return sum(rows(folder).column("wall_s").to_pylist())


def rows(folder):
    """The table of a study's rows."""
    return read_table(next(path for path in map(folder.joinpath, ROWS) if path.is_file()))


def played(folder, out, data, workers):
    """Play the command of a folder into `out`, or resume there; the fault in one line, or None."""
    words = words_of(json.loads((folder / CONFIG).read_text())["command"], data)
    if words is None:
        return f"{folder.name}: not published, give --data with the folder of its recordings"
    print(f"{folder.name}: {shlex.join(words)}", flush=True)
    began = time.monotonic()
    ended = run([*words, "--out", out, "--workers", str(workers)])
    print(f"{folder.name}: {(time.monotonic() - began) / 60:.1f} minutes")
    return ended and f"{folder.name}: not published, it ended with {ended}"


def run(words):
    """Run Python with these words in this tree, whatever they print; returns how it ended."""
    # Policies of examples are files of the folder that the command is run in.
    return subprocess.run(
        [sys.executable, *words],
        cwd=EXAMPLES,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        check=False,
    ).returncode


def b90_anew(made, data, workers):
    """Play and publish the entries of the benchmark; 1 where recordings or plays are missing."""
    if data is None:
        print("b90: not published, give --data with the folder of its recordings")
        return 1
    recorded = [f"{kind}:{data.resolve() / name}" for kind, name in RECORDINGS.items()]
    script = [ROOT / "docs" / "b90_results.py", "--recorded", *recorded, "boreas"]
    return int(run([*script, "--plays", made, "--workers", str(workers)]) != 0)


def words_of(command, data):
    """The words of a published command after `python`; None where recordings are not at hand."""

    def numbers(sequence):
        first, last = map(int, sequence.groups())
        return " ".join(map(str, range(first, last + 1)))

    words = shlex.split(re.sub(r"\$\(seq (\d+) (\d+)\)", numbers, command))
    for at, word in enumerate(words):
        kind, _, place = word.partition(":")
        if place == "FOLDER":
            if data is None or not (data / RECORDINGS[kind]).is_dir():
                return None
            words[at] = f"{kind}:{(data / RECORDINGS[kind]).resolve()}"
    return ["-m", "care_sim", *words[1:]]


def published(folder, made):
    """Replace the files of a published folder by those that were made, and print what changed; the
    fault in one line, or None.
    """
    names = {path.name for path in folder.iterdir()} - KEPT
    if lacking := sorted(name for name in names if not (made / name).is_file()):
        return f"{folder.name}: not published, {made} has no {', '.join(lacking)}"
    before, after = rows(folder), rows(made)
    hashes = [Counter(each.column("episode_hash").to_pylist()) for each in (before, after)]
    other = (hashes[1] - hashes[0]).total()
    print(f"{folder.name}: {other:,} of {len(after):,} rows differ; there were {len(before):,}")
    tables = [(each / TABLES).read_text() for each in (folder, made)]
    changed = [*changed_lines(*tables)]
    for line in changed[:SHOWN]:
        print(f"  {line}")
    if len(changed) > SHOWN:
        print(f"  and {len(changed) - SHOWN} further lines of {TABLES}")
    # The configuration comes last: what it says of the code is said of all files beside it.
    for name in sorted(names, key=lambda name: name == CONFIG):
        content = (made / name).read_bytes()
        if name == CONFIG:
            content = with_command(content.decode(), (folder / CONFIG).read_text()).encode()
        with replacing(folder / name) as unfinished:
            unfinished.write_bytes(content)
    golden = read_golden() | {folder.name: cells_of(folder.name)}
    write_golden(cell for name in folders() for cell in golden[name])
    write_index()
    return None


def write_index():
    """Write the page that lists the folders."""
    index = loaded(ROOT / "docs" / "results_index.py")
    index.PAGE.write_text(index.written(), encoding="utf-8")


def with_command(config, published_config):
    """A configuration with the command as it is published: without workers, with $(seq ...)."""
    command = json.dumps(json.loads(published_config)["command"])
    return re.sub(r'(?<=^ "command": ).*(?=,$)', lambda _: command, config, count=1, flags=re.M)


def changed_lines(before, after):
    """Lines of two texts that differ in more than numbers: in a sign, a mark, bold, a name."""
    lines = [before.splitlines(), after.splitlines()]
    words = [[re.sub(r"[\d.,%]+", "0", line) for line in text] for text in lines]
    for kind, a, b, c, d in SequenceMatcher(None, *words, autojunk=False).get_opcodes():
        if kind != "equal":
            yield from (f"- {line}" for line in lines[0][a:b])
            yield from (f"+ {line}" for line in lines[1][c:d])


if __name__ == "__main__":
    sys.exit(main())
