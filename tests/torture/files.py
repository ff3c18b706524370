"""Campaign: damaged, changed and foreign files, read by the commands and calls that read such
files.
"""

import json
import os
import tempfile
from functools import lru_cache
from pathlib import Path

from tests.torture import calls, props, spoil
from tests.torture.case import DONE, Case, Fault, Name
from tests.torture.commands import run
from tests.torture.judge import call

LIMIT_S = 10.0


def prepare(_name):
    import care_sim.reports.page.build
    import care_sim.sources.street_films
    import care_sim.study.scene_play
    import care_sim.training.curves_figure  # noqa: F401

    for name in ("results", "protocol", "drive", "base", "scorer", "ppo", "trained", "recording"):
        props.template(name)
    calls.good_env()
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
                if kind is not recordings and kind(_Pristine(Name("files", 0, 0), place)) != DONE:
                    raise RuntimeError(f"refused as it is: {kind.__name__}")
        finally:
            os.chdir(here)


class _Pristine(Case):
    """A case that damages nothing."""


def play(case):
    kind = case.rng.choices(list(KINDS), list(KINDS.values()))[0]
    case.tell(kind.__name__)
    return kind(case)


def _spoilt(case, path, *own):
    """Damage a file in one of its own ways, or in one that fits every file."""
    if isinstance(case, _Pristine):
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


def _feather(rng, path):
    from pyarrow import feather

    return spoil.table(
        rng,
        lambda: feather.read_table(path, memory_map=False),
        lambda table: feather.write_feather(table, path),
    )


def _parquet(rng, path):
    import pyarrow.parquet as pq

    return spoil.table(
        rng,
        lambda: pq.read_table(path, memory_map=False),
        lambda table: pq.write_table(table, path),
    )


ONE_POLICY = (
    "--policies",
    "care",
    "--budgets",
    "0.1",
    "--floor-seeds",
    "1",
    "--workers",
    "1",
    "--out",
    "out",
)


def argoverse2(case):
    """A log: poses and annotations."""
    folder = props.copy("drive", case.folder / "drive")
    _spoilt(case, case.rng.choice(sorted(folder.glob("*.feather"))), _feather)
    return _recorded(case, "argoverse2:drive")


def nuscenes(case):
    """A database: tables and sweeps."""
    folder = props.copy("base", case.folder / "base")
    if case.rng.random() < 0.75:
        _spoilt(
            case, case.rng.choice(sorted(folder.rglob("*.json"))), spoil.json_node, spoil.json_node
        )
    else:
        _spoilt(case, case.rng.choice(sorted(folder.rglob("*.bin"))), spoil.points)
    return _recorded(case, "nuscenes:base", exporting=True)


def _recorded(case, source, exporting=False):
    roll = case.rng.random()
    if roll < 0.6:
        return _replayed(source)
    if roll < 0.8 and exporting:
        return run(("export", "--source", source, "--out", "out.json"))
    return run(("protocol", "--source", source, "--scenes", "1", *ONE_POLICY))


def _replayed(source, **options):
    import gymnasium

    import care_sim

    try:
        with gymnasium.make(
            "CARE-Replay-v0", source=source, disable_env_checker=True, **options
        ) as env:
            policy = care_sim.make_policy("care", env)
            observation, _ = env.reset(seed=0)
            for _ in range(3):
                calls.check_observation(env, observation)
                observation, _, _, over, _ = env.step(policy(observation))
                if over:
                    break
    except Fault:
        raise
    except Exception as error:
        return call(error)
    return DONE


def camera_detections(case):
    """Results of a camera detector, in the form of nuScenes or COCO."""
    root = props.template("base")
    data = json.loads((root / "v1.0-trainval" / "sample_data.json").read_text())
    tokens = [row["token"] for row in data if "CAM" in row["token"]]
    coco = [
        {"image_id": token, "category_id": 1, "bbox": [100.0, 100.0, 50.0, 40.0], "score": 0.9}
        for token in tokens[:5]
    ]
    form = {
        "results": {
            token: [{"bbox": [100, 100, 150, 140], "category_name": "car", "score": 0.8}]
            for token in tokens
        }
    }
    path = case.folder / "boxes.json"
    path.write_text(json.dumps(case.rng.choice((coco, form))))
    _spoilt(case, path, spoil.json_node)
    return _replayed(f"nuscenes:{root}", camera_detections=str(path))


def splits(case):
    """A split of one's own."""
    root = props.copy("base", case.folder / "base")
    path = root / "v1.0-trainval" / "splits.json"
    path.write_text(json.dumps({"mine": ["scene-0103"]}))
    _spoilt(case, path, spoil.json_node)
    return _replayed("nuscenes:base", split="mine")


def weights(case):
    """Weights of a learned policy."""
    name, policy = case.rng.choice((("scorer", "learned-scorer"), ("ppo", "ppo")))
    path = props.copy(name, case.folder / "w.npz")
    _spoilt(case, path, spoil.weights)
    options = ("--policy", policy, "--policy-parameters", "path=w.npz", "--budget", "0.03")
    return run(("run", "dense", *options, *props.SHORT))


def results(case):
    """Results of a closed-loop study."""
    folder = props.copy("results", case.folder / "results")
    path = case.rng.choice(("episodes.parquet", "episodes.parquet", "config.json", "journal.jsonl"))
    own = {"config.json": spoil.json_node, "journal.jsonl": spoil.json_lines_node}.get(
        path, _parquet
    )
    _spoilt(case, folder / path, own)
    return run(
        case.rng.choice(
            (("report", "results"), ("report", "results", "-o", "page.html", "--episodes", "0"))
        )
    )


def plays(case):
    """Results of the protocol."""
    folder = props.copy("protocol", case.folder / "results")
    path = case.rng.choice(("plays.parquet", "plays.parquet", "events.parquet", "config.json"))
    _spoilt(case, folder / path, spoil.json_node if path == "config.json" else _parquet)
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
            ("rules.json", spoil.json_node),
            ("curve.csv", spoil.csv),
        )
    )
    _spoilt(case, folder / path, own)
    return run(("train", "curves", "trained", "--out", "curve.png"))


def recordings(case):
    """A recording whose first bytes are not those of one; others are the viewer's, a process of its
    own.
    """
    path = props.copy("recording", case.folder / "out.rrd")
    _spoilt(case, path)
    if path.is_file() and path.stat().st_mode & 0o400 and path.read_bytes()[:3] == b"RRF":
        return DONE
    return run(("view", "out.rrd"))


KINDS = {
    argoverse2: 6,
    nuscenes: 6,
    camera_detections: 3,
    splits: 1,
    weights: 4,
    results: 4,
    plays: 2,
    training: 2,
    recordings: 1,
}
"""What is read, and how often."""
