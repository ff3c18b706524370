"""A fault of a log is reported in one line that names the file."""

import json
import shutil

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.sources.installed import recordings
from tests.helpers.sweeps_log import START_NS, STEP_NS, pcd_header, stamps, sweep, write_log


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    return write_log(tmp_path_factory.mktemp("log") / "drive", seconds=1.2)


@pytest.fixture
def folder(tmp_path, sound):
    return shutil.copytree(sound, tmp_path / "drive")


def swept(folder, suffix=".npy", number=5):
    """The path of a sweep that the film reads."""
    return folder / "sweeps" / f"{START_NS + number * STEP_NS}{suffix}"


def posed(folder, lines):
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")


def rows(x_of=lambda t: 6 * t, yaw=0.0, shift=0.0, step=1):
    times = stamps(1.2)[::step] * 1e-9
    return ["time,x,y,z,yaw"] + [
        f"{t + shift:.6f},{x_of(t - times[0]):.6f},0,0,{yaw}" for t in times
    ]


def points(**changes):
    """Write another sweep: rows by number, or all of it."""

    def damage(folder):
        table = np.array(changes.get("all", sweep(0.5)))
        for row, value in changes.items():
            if row != "all":
                table[int(row[1:]), 1] = value
        np.save(swept(folder), table)

    return damage


def left(numbers):
    """Leave out some sweeps."""

    def damage(folder):
        for number in numbers:
            swept(folder, number=number).unlink()

    return damage


def poses(*lines):
    return lambda folder: posed(folder, lines)


def boxes(picture):
    row = {"image_id": picture, "category_id": 1, "bbox": [0, 0, 9, 9], "score": 1}
    return lambda folder: (folder / "camera_boxes.json").write_text(json.dumps([row]))


def truncated(folder):
    path = swept(folder)
    path.write_bytes(path.read_bytes()[:-100])


def numbered(folder):
    for number, path in enumerate(sorted((folder / "sweeps").iterdir())):
        path.rename(path.with_name(f"{number:06d}.npy"))


def upside_down(folder):
    for path in (folder / "sweeps").iterdir():
        np.save(path, np.load(path) * [1, -1, -1])


FAULTS = [
    (truncated, r"\d+\.npy: no sweep \(mmap length"),
    (points(all=sweep(0.5) * 1000), r"\d+\.npy: point 0 lies at .*, must be metres within 500"),
    (points(r7=np.inf), r"\d+\.npy: point 7 lies at .*inf"),
    (points(r7=np.nan), r"\d+\.npy: point 7 lies at .*nan"),
    (points(all=np.full((9, 3), np.nan)), r"\d+\.npy: no points"),
    (points(all=sweep(0.5)[:, :2]), r"\d+\.npy: no sweep \(must be numbers \(n, 3 or more\)"),
    (points(all=[{}]), r"\d+\.npy: no sweep \("),
    (
        lambda folder: (folder / "sweeps" / "1.csv").write_text("1,2,3\n"),
        r"sweeps must be files of one kind, .*, got \.csv and \.npy",
    ),
    (numbered, r"000000\.npy: its name is no time: nano-, micro- or .* write times\.csv"),
    (
        lambda folder: shutil.copy(swept(folder), folder / f"sweeps/0{swept(folder).name}"),
        r"sweeps: times must ascend, got",
    ),
    (left(range(2, 9)), r"sweeps: no sweep within 0\.25 s of second 0\.5 of the log"),
    (left(range(6, 13)), r"sweeps: a film needs 3 keyframes, .*, and the sweeps are enough for 2"),
    (upside_down, r"sweeps: no returns below the LiDAR within 12 m; z must point up"),
    (lambda folder: (folder / "poses.csv").unlink(), r"poses\.csv: no such file; it holds the"),
    (poses(), r"poses\.csv: no CSV table"),
    (poses(*rows()[:1]), r"poses\.csv: times must be finite, at least one"),
    (poses("time,x,y,z", "1,2,3,4"), r"must have one column qx, has"),
    (poses(*rows(), "x,0,0,0,0"), r"column time must hold numbers"),
    (poses(*rows(), rows()[3]), r"poses\.csv: times must ascend"),
    (poses(*rows(yaw=90.0)), r"yaw must be radians within a full turn, got"),
    (poses(*rows(yaw=1.5)), r"drives 86 degrees off its heading; yaw is"),
    (poses(*rows(lambda t: 6000 * t)), r"drives 6000 m/s; x, y and z must"),
    (poses(*rows(shift=100)), r"sweep at .* s has no pose; poses of .* go"),
    (poses(*rows(step=12)), r"must be at most 1 s apart"),
    (poses("time,x,y,z,qx,qy,qz,qw", "1,0,0,0,0,0,0,0"), r"pose 0 has a quaternion that is not"),
    (
        lambda folder: (folder / "times.csv").write_text("file,time\n1.npy,0\n"),
        r"times\.csv: no row of columns file and time for \d+\.npy",
    ),
    (boxes("front"), r"camera_boxes\.json: the picture 'front' must be named CAMERA/TIME"),
    (boxes("0/1.5"), r"cameras must be numbers from 0 on of the 0 \[\[cameras\]\]"),
]


@pytest.mark.parametrize(("damage", "told"), FAULTS)
def test_a_fault_is_told_in_a_line(folder, damage, told):
    damage(folder)
    with pytest.raises(InvalidInput, match=told) as caught:
        recordings(f"sweeps:{folder}").film("drive")
    assert str(folder) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (pcd_header(2, "ascii") + "1 2 3\n4 5", "no sweep"),
        (pcd_header(2, "ascii") + "1 2 3\n4 5 x", "no sweep"),
        (pcd_header(2, "ascii", fields="x y i") + "1 2 3\n4 5 6", "it lacks 'z'"),
        (pcd_header(2, "binary") + "12345678", "no sweep"),
        (pcd_header(2, "binary", types="F F Q") + "1" * 24, "it lacks 'Q'"),
        (pcd_header(2, "binary", sizes="4 4 5") + "1" * 26, "no sweep"),
        (pcd_header(-2, "binary") + "1" * 24, "no sweep"),
        (pcd_header(2, "binary_compressed") + "1" * 24, "DATA binary_compressed, must be ascii"),
        ("no header", "it lacks 'DATA'"),
        ("\xff\xfe", "no sweep"),
    ],
)
def test_a_fault_of_a_point_cloud_is_told_in_a_line(folder, content, told):
    for path in (folder / "sweeps").iterdir():
        path.rename(path.with_suffix(".pcd"))
    for path in (folder / "sweeps").iterdir():
        path.write_bytes(content.encode("latin-1"))
    with pytest.raises(InvalidInput, match=told):
        recordings(f"sweeps:{folder}").film("drive")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"reference": "returns"}, "reference must be a detector that sees points alone"),
        ({"reference": "nothing"}, "nothing"),
        ({"topics": "/points"}, "topics must be a list of names, got '/points'"),
        ({"sensor": "nothing"}, "unknown sensor 'nothing'"),
        ({"sensor": "roof-and-corners"}, "sweeps are of one LiDAR, roof-and-corners has several"),
        ({"split": "val"}, "split has no meaning for sweeps recordings"),
    ],
)
def test_options_are_checked(sound, options, told):
    with pytest.raises(InvalidInput, match=told):
        recordings(f"sweeps:{sound}", options).film("drive")


def test_a_folder_without_a_scene_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match="no scene, a bag or a folder with sweeps/"):
        recordings(f"sweeps:{tmp_path}").scenes()
    with pytest.raises(InvalidInput, match=r"nowhere\.mcap is no folder"):
        recordings(f"sweeps:{tmp_path / 'nowhere.mcap'}")
