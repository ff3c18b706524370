"""Makes the file of the Boreas drive in the package from its labels and poses:

python -m tests.helpers.boreas_file FOLDER/boreas-objects-v1 care_sim/sources/shipped/boreas.npz
"""

import csv
import sys
from pathlib import Path

import numpy as np

POSE = ("easting", "northing", "altitude", "roll", "pitch", "heading")


def columns(folder):
    """Stamps and poses by frame; frames, objects, types and boxes (x, y, z, length, width, height,
    yaw in the frame of the labels) by label.
    """
    files = sorted((folder / "labels_detection").glob("*.txt"), key=lambda path: int(path.stem))
    stamps = [int(path.stem) for path in files]
    with (folder / "applanix" / "lidar_poses.csv").open(encoding="utf-8") as lines:
        poses = {int(row["ROSTime"]): row for row in csv.DictReader(lines)}
    labels = [
        (frame, *line.split())
        for frame, path in enumerate(files)
        for line in path.read_text(encoding="utf-8").splitlines()
    ]
    frames, ids, types, *numbers, _points = zip(*labels, strict=True)
    length, width, height, x, y, z, yaw = np.array(numbers, dtype=float)
    return {
        "microseconds": np.array(stamps),
        "poses": np.array([[float(poses[stamp][name]) for name in POSE] for stamp in stamps]),
        "frames": np.array(frames, dtype=np.int16),
        "objects": np.unique(ids, return_inverse=True)[1].astype(np.int16),
        "types": np.array(types),
        "boxes": np.column_stack([x, y, z, length, width, height, yaw]),
    }


if __name__ == "__main__":
    np.savez_compressed(sys.argv[2], **columns(Path(sys.argv[1])))
