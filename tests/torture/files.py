"""Campaign: damaged, changed and foreign files, read by the commands that read such files; those of
recorded drives have a campaign of their own.
"""

import os
import tempfile
from functools import lru_cache
from pathlib import Path

from tests.torture import props, spoil
from tests.torture.case import DONE, Case, Name
from tests.torture.commands import run

LIMIT_S = 10.0


def prepare(_name):
    import care_sim.reports.page.build
    import care_sim.sources.street_films
    import care_sim.study.scene_play
    import care_sim.training.curves_figure  # noqa: F401

    for name in ("results", "protocol", "drive", "base", "scorer", "ppo", "trained", "recording"):
        props.template(name)
    _check_pristine()


@lru_cache(maxsize=1)
def _check_pristine():
    """What is as the program left it is accepted, or no damage to it would tell anything."""
    with tempfile.TemporaryDirectory(dir=os.environ.get("TORTURE_FOLDER")) as folder:
        here = os.getcwd()
        os.chdir(folder)
        try:
            for kind in KINDS:
                place = Path(folder) / kind.__name__
                place.mkdir()
                os.chdir(place)
                if kind is not recordings and kind(Pristine(Name("files", 0, 0), place)) != DONE:
                    raise RuntimeError(f"refused as it is: {kind.__name__}")
        finally:
            os.chdir(here)


class Pristine(Case):
    """A case that damages nothing."""


def play(case):
    kind = case.rng.choices(list(KINDS), list(KINDS.values()))[0]
    case.tell(kind.__name__)
    return kind(case)


def spoilt(case, path, *own):
    """Damage a file in one of its own ways, or in one that fits every file."""
    if isinstance(case, Pristine):
        return
    rng = case.rng
    others = [
        file
        for name in ("results", "drive", "base")
        for file in props.template(name).rglob("*")
        if file.is_file()
    ]
    others += [props.template(name) for name in ("scorer", "ppo", "recording")]
    roll = rng.random()
    if own and roll < 0.6:
        told = rng.choice(own)(rng, path)
    elif roll < 0.95:
        told = spoil.raw(rng, path, sorted(others))
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
    folder = props.copy("results", case.folder / "results")
    path = case.rng.choice(("episodes.parquet", "episodes.parquet", "config.json", "journal.jsonl"))
    own = {"config.json": spoil.json_node, "journal.jsonl": spoil.json_lines_node}.get(
        path, _parquet
    )
    spoilt(case, folder / path, own)
    return run(
        case.rng.choice(
            (("report", "results"), ("report", "results", "-o", "page.html", "--episodes", "0"))
        )
    )


def plays(case):
    """Results of the protocol."""
    folder = props.copy("protocol", case.folder / "results")
    path = case.rng.choice(("plays.parquet", "plays.parquet", "events.parquet", "config.json"))
    spoilt(case, folder / path, spoil.json_node if path == "config.json" else _parquet)
    return run(
        case.rng.choice(
            (("report", "results"), ("report", "results", "-o", "page.html", "--episodes", "0"))
        )
    )


def training(case):
    """Folders of training runs."""
    folder = props.copy("trained", case.folder / "trained")
    path, own = case.rng.choice(
        (
            ("config.json", spoil.json_node),
            ("episodes.csv", spoil.csv),
            ("curve.csv", spoil.csv),
        )
    )
    spoilt(case, folder / path, own)
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


KINDS = {
    weights: 4,
    results: 4,
    plays: 2,
    training: 2,
    recordings: 1,
}
"""What is read, and how often."""
