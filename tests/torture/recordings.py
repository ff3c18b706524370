"""Campaign: damaged and foreign recordings of drives, read by replays, the protocol and exports.

Some damage must be refused: a case that plays it all the same is a fault. So is a recording that
another file than the caches of its tables was written to.
"""

import json
import shutil
from dataclasses import dataclass

import numpy as np

import care_sim
from care_sim.sources.recordings import Recordings
from tests.torture import calls, props, spoil
from tests.torture.case import DONE, REFUSED, Fault, words
from tests.torture.commands import run, warm_up
from tests.torture.files import OTHERS, spoilt
from tests.torture.judge import call

LIMIT_S = 10.0
ONE_POLICY = ("--policies", "care", "--budgets", "0.1", "--floor-seeds", "1", "--workers", "1")
ODD_WORDS = ["", "\n", *words("x -1 0 7 90 0.5 1e6 1e308 nan inf Tram Bus")]


def prepare(_name):
    for name in (*OTHERS, *props.LOGS, "bag"):
        props.template(name)
    warm_up()
    calls.good_env()


def play(case):
    kind = case.rng.choices([*KINDS], [*KINDS.values()])[0]
    case.tell(kind.__name__)
    return kind(case)


def _judged(case, folder, source, refused=False, exporting=False, **options):
    """Read a source in `folder` in one of the ways in which sources are read."""
    before = _content(folder)
    roll = case.rng.random()
    if roll < 0.7 or options:
        ended = _replayed(source, **options)
    elif exporting and roll < 0.8:
        ended = run(("export", "nuscenes", "--source", source, "--out", "out.json"))
    else:
        ended = run(("protocol", "--source", source, "--scenes", "1", *ONE_POLICY, "--out", "out"))
    if refused and ended != REFUSED:
        raise Fault("played what must be refused", source)
    if _content(folder) != before:
        raise Fault("a file of a recording was changed", source)
    return ended


def _content(folder):
    """The stamps of the files of a recording, but for the caches of its tables."""
    paths = [path for path in sorted(folder.rglob("*")) if path.suffix != ".arrow"]
    files = [(path, path.lstat()) for path in paths if not path.is_dir()]
    return [(path, stat.st_size, stat.st_mtime_ns) for path, stat in files]


def _replayed(source, **options):
    import gymnasium

    options |= {"source": source, "disable_env_checker": True}
    try:
        with gymnasium.make("CARE-Replay-v0", **options) as env:
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


def argoverse2(case):
    """A log whose files are damaged, or hold other tables."""
    folder = props.copy("drive", case.folder / "drive")
    spoilt(case, case.rng.choice(sorted(folder.glob("*.feather"))), _feather)
    return _judged(case, folder, "argoverse2:drive")


def _feather(rng, path):
    from pyarrow import feather

    return spoil.table(
        rng,
        lambda: feather.read_table(path, memory_map=False),
        lambda table: feather.write_feather(table, path),
    )


def other_log(case):
    """A log whose files are sound, and mean something else; whether it must be refused."""
    from tests.helpers.av2_log import rewrite

    folder = props.copy("drive", case.folder / "drive")
    name, (refused, change) = case.rng.choice([*OTHER_LOGS.items()])
    case.tell(name)
    paths = sorted(folder.glob("*.feather"))
    for path in paths if "timestamp" in name else paths[:1]:
        rewrite(path, change)
    return _judged(case, folder, "argoverse2:drive", refused)


def _with(name, change):
    """A change of a column of a table."""
    return lambda table: table.set_column(
        table.column_names.index(name), name, [change(table[name].to_numpy())]
    )


def _swapped(table):
    names = {"tx_m": "length_m", "length_m": "tx_m"}
    return table.rename_columns([names.get(name, name) for name in table.column_names])


def _one_sweep(table):
    return table.filter(np.asarray(table["timestamp_ns"]) == table["timestamp_ns"][0].as_py())


OTHER_LOGS = {
    "timestamps in microseconds": (True, _with("timestamp_ns", lambda column: column // 1000)),
    "timestamps a second late": (False, _with("timestamp_ns", lambda column: column + 10**9)),
    "signs": (True, _with("category", lambda column: ["SIGN"] * len(column))),
    "one sweep": (True, _one_sweep),
    "swapped columns": (False, _swapped),
    "in the city": (False, _with("tx_m", lambda column: column + 1000.0)),
    "without points": (True, _with("num_interior_pts", lambda column: column * 0)),
}


def kitti(case):
    """A drive of KITTI: one of its files is damaged, or a word of it is another."""
    from tests.helpers.kitti_drive import write

    folder = case.folder / "kitti"
    write(folder, oxts=case.rng.random() < 0.5)
    spoilt(case, case.rng.choice(sorted(folder.rglob("*.txt"))), _word)
    return _judged(case, folder, "kitti:kitti")


def _word(rng, path):
    known = path.read_text().split(" ")
    known[rng.randrange(len(known))] = rng.choice(ODD_WORDS)
    path.write_text(" ".join(known))
    return "word"


def nuscenes(case):
    """A database whose tables, splits or sweeps are damaged, or the boxes of a detector for it."""
    rng, folder = case.rng, props.copy("base", case.folder / "base")
    tables = folder / "v1.0-trainval"
    part = rng.choice(("tables", "tables", "tables", "sweeps", "boxes", "splits"))
    options = {}
    if part == "sweeps":
        spoilt(case, rng.choice(sorted(folder.rglob("*.bin"))), spoil.points)
    elif part == "boxes":
        options = {"camera_detections": str(_boxes(case, tables))}
    elif part == "splits":
        (tables / "splits.json").write_text(json.dumps({"mine": ["scene-0103"]}))
        spoilt(case, tables / "splits.json", spoil.json_node)
        options = {"split": "mine"}
    else:
        if rng.random() < 0.5:
            # Without sweeps boxes become bodies.
            shutil.rmtree(folder / "samples")
            options = rng.choice(({}, {"empty_boxes": True}, {"camera_times": "sweep"}))
        spoilt(case, rng.choice(sorted(folder.rglob("*.json"))), spoil.json_node)
    return _judged(case, folder, "nuscenes:base", exporting=True, **options)


def _boxes(case, tables):
    """Results of a camera detector, in the form of nuScenes or COCO."""
    data = json.loads((tables / "sample_data.json").read_text())
    tokens = [row["token"] for row in data if "CAM" in row["token"]]
    box = {"bbox_corners": [100, 100, 150, 140], "category_name": "car", "score": 0.8}
    coco = {"category_id": 1, "bbox": [100.0, 100.0, 50.0, 40.0], "score": 0.9}
    forms = (
        [coco | {"image_id": token} for token in tokens[:5]],
        {"results": {token: [box] for token in tokens}},
    )
    path = case.folder / "boxes.json"
    path.write_text(json.dumps(case.rng.choice(forms)))
    spoilt(case, path, spoil.json_node)
    return path


def sweeps(case):
    """A log without labels whose files are damaged."""
    form = case.rng.choice((*props.LOGS, "bag"))
    folder = props.copy(form, case.folder / "log")
    path = case.rng.choice(sorted(path for path in folder.rglob("*") if path.is_file()))
    own = {"csv": (spoil.csv,), "headless": (spoil.csv,), "kitti": (spoil.points,)}.get(form, ())
    spoilt(case, path, *((spoil.csv,) if path.name == "poses.csv" else own))
    return _judged(case, folder, "sweeps:log")


def own_boxes(case):
    """Boxes of one's own as JSON, of which a node is another."""
    ego = [[100 + 4.0 * k, 50.0, 10.0, 0.0] for k in range(4)]
    kinds = (("truck", [6.0, 2.2, 2.6]), ("car", [4.0, 2.0, 1.6]), (None, [9.0, 0.5, 3.0]))
    standing = [
        {"id": str(n), "class": label, "size": size, "pose": [118 + 6 * n, 54 + n, 11, n]}
        for n, (label, size) in enumerate(kinds)
    ]
    person = {"id": "b", "class": "pedestrian", "size": [0.6, 0.7, 1.8]}
    boxes = [[*standing, person | {"pose": [122, 56 - k, 10.9, -1.5]}] for k in range(4)]
    folder = case.folder / "mine"
    folder.mkdir()
    drive = {"times_s": [0.5 * k for k in range(4)], "ego": ego, "boxes": boxes}
    (folder / "one.json").write_text(json.dumps(drive))
    spoilt(case, folder / "one.json", spoil.json_node)
    return _judged(case, folder, "tests.torture.recordings:Boxes:mine")


@dataclass(frozen=True)
class Boxes(Recordings):
    """A source of one's own: one film of boxes per JSON file."""

    def scenes(self):
        return sorted(path.stem for path in self.folder.glob("*.json"))

    def film(self, scene):
        try:
            drive = json.loads((self.folder / f"{scene}.json").read_text())
            told = drive["times_s"], drive["ego"], drive["boxes"]
        except (OSError, ValueError, TypeError, LookupError, RecursionError) as error:
            raise care_sim.InvalidInput(f"{scene}.json holds no drive") from error
        return care_sim.film_of_boxes(scene, *told)


KINDS = {argoverse2: 5, other_log: 2, nuscenes: 8, own_boxes: 4, kitti: 5, sweeps: 6}
"""Recordings that are read, and how often."""
