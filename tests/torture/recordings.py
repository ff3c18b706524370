"""Campaign: damaged and foreign recordings of drives, read by replays, the protocol and exports.

Some damage must be refused: a case that plays it all the same is a fault. So is a recording that
another file than the caches of its tables was written to.
"""

import json
import shutil

import numpy as np

from tests.torture import calls, props, spoil
from tests.torture.case import DONE, REFUSED, Fault
from tests.torture.commands import run
from tests.torture.files import spoilt
from tests.torture.judge import call

LIMIT_S = 10.0
ONE_POLICY = ("--policies", "care", "--budgets", "0.1", "--floor-seeds", "1", "--workers", "1")
NOT_FINITE = (float("nan"), float("inf"), float("-inf"))


def prepare(_name):
    import tests.torture.own_boxes  # noqa: F401

    for name in ("results", "drive", "base", "scorer", "ppo", "recording"):
        props.template(name)
    calls.good_env()


def play(case):
    kind = case.rng.choices(list(KINDS), list(KINDS.values()))[0]
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
        line = ("protocol", "--source", source, "--scenes", "1", *ONE_POLICY, "--out", "out")
        ended = run(line)
    if refused and ended != REFUSED:
        raise Fault("played what must be refused", source)
    if _content(folder) != before:
        raise Fault("a file of a recording was changed", source)
    return ended


def _content(folder):
    """The stamps of the files of a recording, but for the caches of its tables."""
    paths = [path for path in sorted(folder.rglob("*")) if path.suffix != ".arrow"]
    stats = [path.lstat() for path in paths]
    files = zip(paths, stats, strict=True)
    return [(path, stat.st_size, stat.st_mtime_ns) for path, stat in files if not path.is_dir()]


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
    """A log whose files are sound, and mean something else."""
    from tests.helpers.av2_log import rewrite

    rng = case.rng
    folder = props.copy("drive", case.folder / "drive")
    change, refused = rng.choice(OTHER_LOGS)
    case.tell(change.__name__)
    if change in (_second_file, _only_copies, _no_poses):
        change(rng, folder)
    else:
        paths = sorted(folder.glob("*.feather"))
        for path in paths if change in (_microseconds, _seconds_late) else paths[:1]:
            rewrite(path, lambda table: change(rng, table))
    here = rng.choice(("argoverse2:drive", "argoverse2:.", f"argoverse2:{case.folder}"))
    return _judged(case, folder, here, refused)


def _microseconds(rng, table):
    return _column(table, "timestamp_ns", lambda stamps: stamps // 10 ** rng.choice((3, 6)))


def _seconds_late(_rng, table):
    return _column(table, "timestamp_ns", lambda stamps: stamps + 10**9)


def _no_objects(_rng, table):
    return table.set_column(
        table.column_names.index("category"), "category", [["SIGN"] * len(table)]
    )


def _one_sweep(_rng, table):
    return table.filter(np.asarray(table["timestamp_ns"]) == table["timestamp_ns"][0].as_py())


def _swapped_columns(rng, table):
    one, other = rng.sample(("tx_m", "ty_m", "tz_m", "length_m", "width_m", "height_m"), 2)
    swapped = {one: other, other: one}
    return table.rename_columns([swapped.get(name, name) for name in table.column_names])


def _in_the_city(_rng, table):
    return _column(table, "tx_m", lambda places: places + 1000.0)


def _without_points(_rng, table):
    return _column(table, "num_interior_pts", lambda points: points * 0)


def _column(table, name, change):
    values = change(table[name].to_numpy())
    return table.set_column(table.column_names.index(name), name, [values])


def _second_file(rng, folder):
    copy = folder / rng.choice(("annotations (1).feather", "annotations_old.feather"))
    copy.write_bytes(rng.choice((b"", rng.randbytes(200))))


def _only_copies(rng, folder):
    _second_file(rng, folder)
    (folder / "annotations.feather").rename(folder / "annotations-copy.feather")


def _no_poses(_rng, folder):
    (folder / "city_SE3_egovehicle.feather").unlink()


OTHER_LOGS = (
    (_microseconds, True),
    (_seconds_late, False),
    (_no_objects, True),
    (_one_sweep, True),
    (_swapped_columns, False),
    (_in_the_city, False),
    (_without_points, True),
    (_second_file, False),
    (_only_copies, True),
    (_no_poses, True),
)
"""Changes of a log, and whether it must be refused then."""


def kitti(case):
    """A drive of KITTI: one of its files is damaged, or a word of it is another."""
    from tests.helpers.kitti_drive import write

    folder = case.folder / "kitti"
    write(folder, oxts=case.rng.random() < 0.5)
    spoilt(case, case.rng.choice(sorted(folder.rglob("*.txt"))), _word, _word, _word)
    return _judged(case, folder, "kitti:kitti")


def _word(rng, path):
    words = path.read_text().split(" ")
    words[rng.randrange(len(words))] = rng.choice(
        ("", "x", "-1", "0", "7", "90", "0.5", "1e6", "1e308", "nan", "inf", "Tram", "Bus", "\n")
    )
    path.write_text(" ".join(words))
    return "word"


def nuscenes(case):
    """A database whose tables or sweeps are damaged."""
    folder = props.copy("base", case.folder / "base")
    options = {}
    if case.rng.random() < 0.75:
        if case.rng.random() < 0.5:
            # Without sweeps boxes become bodies.
            shutil.rmtree(folder / "samples")
            options = case.rng.choice(({}, {"empty_boxes": True}, {"camera_times": "sweep"}))
        spoilt(
            case, case.rng.choice(sorted(folder.rglob("*.json"))), spoil.json_node, spoil.json_node
        )
    else:
        spoilt(case, case.rng.choice(sorted(folder.rglob("*.bin"))), spoil.points)
    return _judged(case, folder, "nuscenes:base", exporting=True, **options)


def other_sweeps(case):
    """A database whose sweeps have the form of another data set, or lie elsewhere."""
    rng = case.rng
    folder = props.copy("base", case.folder / "base")
    sweeps = sorted(folder.rglob("*.bin"))
    form = rng.choice(("kitti", "waymo", "doubles", "millimetres", "gone", "empty", "folder"))
    case.tell(form)
    chosen = sweeps if rng.random() < 0.5 else sweeps[:1]
    for path in chosen:
        values = np.frombuffer(path.read_bytes(), "<f4").reshape(-1, 5).astype(float)
        path.unlink()
        if form == "folder":
            path.mkdir()
        elif form != "gone":
            path.write_bytes(_other_sweep(form, values, rng).tobytes())
    # Without any sweep boxes become bodies.
    refused = form != "gone" or len(chosen) < len(sweeps)
    return _judged(case, folder, "nuscenes:base", refused, exporting=True)


def _other_sweep(form, values, rng):
    count = 60
    angles = np.array([rng.uniform(0, 7) for _ in range(count)])
    ranges = np.array([rng.uniform(2, 60) for _ in range(count)])
    heights = np.array([rng.uniform(-2, 4) for _ in range(count)])
    places = np.stack([ranges * np.cos(angles), ranges * np.sin(angles), heights], axis=1)
    beside = np.array([[rng.uniform(0, 1) for _ in range(3)] for _ in range(count)])
    if form == "kitti":
        return np.column_stack([places, beside[:, :1]]).astype("<f4")
    if form == "waymo":
        return np.column_stack([places, beside]).astype("<f4")
    if form == "millimetres":
        return (values * [1000, 1000, 1000, 1, 1]).astype("<f4")
    return values if form == "doubles" else np.empty((0, 5), "<f4")


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
            token: [{"bbox_corners": [100, 100, 150, 140], "category_name": "car", "score": 0.8}]
            for token in tokens
        }
    }
    path = case.folder / "boxes.json"
    path.write_text(json.dumps(case.rng.choice((coco, form))))
    spoilt(case, path, spoil.json_node)
    return _judged(case, root, f"nuscenes:{root}", camera_detections=str(path))


def sweeps(case):
    """A log without labels whose files are damaged."""
    form = case.rng.choice((*props.LOGS, "bag"))
    folder = props.copy(form, case.folder / "log")
    own = {"csv": (spoil.csv,), "headless": (spoil.csv,), "kitti": (spoil.points,)}.get(form, ())
    path = case.rng.choice(sorted(path for path in folder.rglob("*") if path.is_file()))
    if path.name == "poses.csv":
        own = (spoil.csv,)
    spoilt(case, path, *own)
    return _judged(case, folder, "sweeps:log")


def other_logs_of_sweeps(case):
    """A log without labels whose files are sound, and mean something else."""
    folder = props.copy("npy", case.folder / "log")
    poses, paths = folder / "poses.csv", sorted((folder / "sweeps").iterdir())
    change = case.rng.choice(("gone", "late", "fast", "sideways", "millimetres", "numbers", "flip"))
    case.tell(change)
    table = np.loadtxt(poses, delimiter=",", skiprows=1)
    if change == "gone":
        poses.unlink()
    elif change in ("late", "fast", "sideways"):
        column, value = {"late": (0, 90.0), "fast": (1, 1e3), "sideways": (4, 1.6)}[change]
        table[:, column] = (
            table[:, column] * value if change == "fast" else value + table[:, column]
        )
        rows = "\n".join(",".join(f"{cell:.6f}" for cell in row) for row in table)
        poses.write_text(f"time,x,y,z,yaw\n{rows}\n")
    elif change == "numbers":
        for number, path in enumerate(paths):
            path.rename(path.with_name(f"{number}.npy"))
    else:
        for path in paths:
            np.save(path, np.load(path) * (1000 if change == "millimetres" else [1, 1, -1]))
    return _judged(case, folder, "sweeps:log", refused=True)


def splits(case):
    """A split of one's own."""
    root = props.copy("base", case.folder / "base")
    path = root / "v1.0-trainval" / "splits.json"
    path.write_text(json.dumps({"mine": ["scene-0103"]}))
    spoilt(case, path, spoil.json_node)
    return _judged(case, root, "nuscenes:base", split="mine")


def own_boxes(case):
    """Boxes of one's own as JSON: a node of it is another, or all of it is in another frame."""
    rng = case.rng
    drive = _drive()
    roll = rng.random()
    refused = False
    if roll < 0.4:
        change, refused = rng.choice(OTHER_DRIVES)
        case.tell(change.__name__)
        change(rng, drive)
    elif roll < 0.7:
        change = rng.choice(OTHER_FILMS)
        case.tell(change)
        part, field, values, refused = change
        drive["spoilt"] = [[part, field, rng.randrange(3), rng.choice(values)]]
    folder = case.folder / "mine"
    folder.mkdir()
    (folder / "one.json").write_text(json.dumps(drive))
    if roll >= 0.7:
        spoilt(case, folder / "one.json", spoil.json_node, spoil.json_node)
    return _judged(case, folder, "tests.torture.own_boxes:Boxes:mine", refused)


def _drive():
    """What `film_of_boxes` takes: 8 m/s past what stands and one who walks."""
    ego = [[100 + 4.0 * k, 50.0, 10.0, 0.0] for k in range(4)]
    boxes = [
        [
            {"id": "van", "class": "truck", "size": [6.0, 2.2, 2.6], "pose": [118, 54, 11.3, 0]},
            {"id": "car", "class": "car", "size": [4.0, 2.0, 1.6], "pose": [126, 46, 10.8, 3]},
            {"id": "b", "class": "pedestrian", "size": [0.6, 0.7, 1.8]}
            | {"pose": [122, 56 - k, 10.9, -1.5]},
            {"id": "wall", "class": None, "size": [9.0, 0.5, 3.0], "pose": [130, 60, 11.5, 0]},
        ]
        for k in range(4)
    ]
    return {"times_s": [0.5 * k for k in range(4)], "ego": ego, "boxes": boxes}


def _each(drive):
    return [box for keyframe in drive["boxes"] for box in keyframe]


def _degrees(_rng, drive):
    for box in _each(drive):
        box["pose"][3] = 90.0


def _cars_frame(_rng, drive):
    for car, keyframe in zip(drive["ego"], drive["boxes"], strict=True):
        for box in keyframe:
            box["pose"][:3] = np.subtract(box["pose"][:3], car[:3]).tolist()


def _flat(rng, drive):
    rng.choice(_each(drive))["size"][rng.randrange(3)] = rng.choice((0, -1, 1e9, *NOT_FINITE))


def _nowhere(rng, drive):
    rng.choice([*drive["ego"], *(box["pose"] for box in _each(drive))])[rng.randrange(4)] = (
        rng.choice((1e300, *NOT_FINITE))
    )


def _backwards(_rng, drive):
    drive["times_s"].reverse()


def _nobody(_rng, drive):
    drive["boxes"] = [[] for _ in drive["boxes"]]


def _short(rng, drive):
    for column in drive.values():
        del column[rng.choice((0, 1, 2)) :]


def _still(_rng, drive):
    drive["ego"] = [drive["ego"][0]] * 4


def _crowd(rng, drive):
    for keyframe in drive["boxes"]:
        keyframe += [dict(keyframe[2], id=n) for n in range(rng.choice((1, 300)))]


OTHER_DRIVES = (
    (_degrees, True),
    (_cars_frame, False),
    (_flat, True),
    (_nowhere, True),
    (_backwards, True),
    (_nobody, True),
    (_short, True),
    (_still, False),
    (_crowd, False),
)
"""Changes of a drive, and whether it must be refused then."""
OTHER_FILMS = (
    ("annotations", "boxes", NOT_FINITE, True),
    ("annotations", "classes", (-1, 5, 10**6), True),
    ("annotations", "objects", (10**6,), False),
    ("cloud", "points", NOT_FINITE, True),
    ("cloud", "cells", (-1, 10**6), True),
    ("cloud", "objects", (-7, 10**6), False),
    ("sensor", "yaw", (90.0, *NOT_FINITE), True),
    ("sensor", "x", NOT_FINITE, True),
    ("ego", "speed", NOT_FINITE, True),
    ("shot", "time_s", (0.0, 100.0, *NOT_FINITE), True),
    ("shot", "token", ("", "\ud800", "x" * 10_000), False),
    ("shots", "", (0,), True),
)
"""Part and field of a film, what stands there instead, and whether it must be refused then."""
KINDS = {
    argoverse2: 5,
    other_log: 4,
    nuscenes: 5,
    other_sweeps: 3,
    camera_detections: 2,
    splits: 1,
    own_boxes: 6,
    kitti: 5,
    sweeps: 6,
    other_logs_of_sweeps: 2,
}
"""What is read, and how often."""
