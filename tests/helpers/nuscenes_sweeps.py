"""Adds the sweeps between keyframes to a database of `tests.helpers.nuscenes_database`."""

import json

import numpy as np

from tests.helpers.nuscenes_database import START_US, write


def write_swept(root, scenes):
    """As `write`; every sample has as a fourth member its earlier sweeps, each a tuple of seconds
    before the sample, pose, and points (n, 5).
    """
    write(root, {name: [sample[:3] for sample in samples] for name, samples in scenes.items()})
    folder = root / "v1.0-trainval"
    (root / "sweeps" / "LIDAR_TOP").mkdir(parents=True)
    tables = {name: json.loads((folder / f"{name}.json").read_text()) for name in _TABLES}
    own = {row["token"]: row for row in tables["sample_data"]}
    for name, samples in scenes.items():
        for n, (*_, earlier) in enumerate(samples):
            for number, (ago_s, car, points) in enumerate(earlier):
                token = f"{name}-{n}-LIDAR_TOP"
                between = {
                    "token": f"{token}-{number}",
                    "ego_pose_token": f"pose-{token}-{number}",
                    "is_key_frame": False,
                    "timestamp": START_US + n * 500_000 - round(ago_s * 1e6),
                    "filename": f"sweeps/LIDAR_TOP/{token}-{number}.pcd.bin",
                }
                tables["sample_data"].append(own[token] | between)
                tables["ego_pose"].append({"token": f"pose-{token}-{number}", "timestamp": 0} | car)
                np.asarray(points, "<f4").tofile(root / between["filename"])
    for name, rows in tables.items():
        (folder / f"{name}.json").write_text(json.dumps(rows))
    return root


_TABLES = ("sample_data", "ego_pose")
