"""Campaign: damaged, changed and foreign files, read by the commands that read such files; those of
recorded drives have a campaign of their own.

Torn journals are among them: the same command must give the same rows, or say in one line why not.
"""

import json

from tests.torture import props, spoil, study
from tests.torture.case import DONE, FOUND, REFUSED, Fault
from tests.torture.commands import run, warm_up

LIMIT_S = 20.0
OTHERS = ("results", "drive", "base", "scorer", "ppo", "recording")


def prepare(_name):
    for name in (*OTHERS, "protocol", "trained"):
        props.template(name)
    warm_up()
    study.expected()


def play(case):
    if case.name.seed == FOUND:
        ended = FOUND_CASES[case.name.number](case)
        if ended != DONE:
            raise Fault("refused as it is", case.name)
        return ended
    kind = case.rng.choices([*KINDS], [*KINDS.values()])[0]
    case.tell(kind.__name__)
    return kind(case)


def spoilt(case, path, *own):
    """Damage a file in one of its own ways, or in one that fits every file."""
    if case.name.seed == FOUND:
        return
    rng, roll = case.rng, case.rng.random()
    if own and roll < 0.6:
        told = rng.choice(own)(rng, path)
    elif roll < 0.95:
        places = [place for name in OTHERS for place in (props.template(name),)]
        files = [file for place in places for file in (place, *place.rglob("*"))]
        told = spoil.raw(rng, path, sorted(file for file in files if file.is_file()))
    else:
        told = spoil.instead(rng, path)
    case.tell(f"{path.relative_to(case.folder)}: {told}")


def _parquet(rng, path):
    import pyarrow.parquet as pq

    return spoil.table(
        rng,
        lambda: pq.read_table(path, memory_map=False),
        lambda table: pq.write_table(table, path),
    )


def weights(case):
    """Weights of a learned policy."""
    name, policy = case.rng.choice((("scorer", "learned-scorer"), ("ppo", "ppo")))
    path = props.copy(name, case.folder / "w.npz")
    spoilt(case, path, spoil.weights)
    options = ("--policy", policy, "--policy-parameters", "path=w.npz", "--budget", "0.03")
    return run(("run", "dense", *options, *props.SHORT))


def results(case):
    """Results of a closed-loop study."""
    return _reported(case, "results", "episodes.parquet", "config.json", "journal.jsonl")


def plays(case):
    """Results of the protocol."""
    return _reported(case, "protocol", "plays.parquet", "events.parquet", "config.json")


def _reported(case, template, rows, *others):
    folder = props.copy(template, case.folder / "results")
    path = folder / case.rng.choice((rows, rows, *others))
    own = {".json": spoil.json_node, ".jsonl": spoil.json_lines_node}.get(path.suffix, _parquet)
    spoilt(case, path, own)
    page = ("report", "results", "-o", "page.html", "--episodes", "0")
    return run(case.rng.choice((page, page[:2])))


def training(case):
    """Folders of training runs."""
    folder = props.copy("trained", case.folder / "trained")
    path = folder / case.rng.choice(("config.json", "episodes.csv", "curve.csv"))
    spoilt(case, path, spoil.csv if path.suffix == ".csv" else spoil.json_node)
    return run(("train", "curves", "trained", "--out", "curve.png"))


def recordings(case):
    """A recording whose first bytes are not those of one; others are the viewer's, a process of its
    own.
    """
    path = props.copy("recording", case.folder / "out.rrd")
    spoilt(case, path)
    if path.is_file() and path.stat().st_mode & 0o400 and path.read_bytes()[:3] == b"RRF":
        return DONE
    return run(("view", "out.rrd"))


def journal(case):
    """A journal that is changed, or torn by a crash, which keeps no study from going on."""
    rng, out = case.rng, props.copy("undisturbed", case.folder / "out")
    path = out / study.JOURNAL
    if rng.random() < 0.7:
        for other in out.iterdir():
            if other != path:
                other.unlink()
    is_torn = rng.random() < 0.5
    if is_torn:
        path.write_bytes(_torn(rng, path.read_bytes()))
    elif case.name.seed != FOUND:
        change = rng.choice((spoil.raw, spoil.json_lines_node, _other_digits, _swapped_digests))
        case.tell(f"{change.__name__}: {change(rng, path)}")
    ended = run(study.command("out", workers=1))
    if ended == DONE:
        study.check_whole(out, once=False)
    elif ended == REFUSED and is_torn:
        raise Fault("a torn journal that keeps the study from going on")
    return ended


def _torn(rng, data):
    """The rest of a journal after a crash, or after somebody joined and sorted files."""
    lines = data.splitlines(keepends=True)
    at = rng.randrange(len(data))
    return rng.choice(
        (
            data[:at],
            # Some file systems keep the length when the power fails, and the last block is zeros.
            data[:at] + bytes(len(data) - at),
            b"".join(line * rng.choice((1, 1, 2, 3)) for line in lines),
            b"".join(line for line in lines if rng.random() < 0.7),
            b"".join(rng.sample(lines, len(lines))),
            b"".join(line + rng.choice((b"", b"\n", b" \n", b"\r\n")) for line in lines),
        )
    )


def _other_digits(rng, path):
    """As a bit of a digit flips: the line stays JSON."""
    data = bytearray(path.read_bytes())
    at = rng.choice([at for at, byte in enumerate(data) if chr(byte).isdigit()])
    data[at] = ord(rng.choice("0123456789"))
    path.write_bytes(data)
    return f"byte {at}"


def _swapped_digests(rng, path):
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    one, other = rng.sample(rows, 2)
    one["digest"], other["digest"] = other["digest"], one["digest"]
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    return "two rows"


KINDS = {weights: 4, results: 4, plays: 2, training: 2, recordings: 1, journal: 3}
"""Files that are read, and how often."""
FOUND_CASES = (weights, results, plays, training, journal)
"""Played without damage, or no damage would tell anything."""
