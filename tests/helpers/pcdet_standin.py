"""A small network in the interface of OpenPCDet, which does not install where tests run. A test
puts this file in the place of the package `pcdet`, and may put another `answer` into it.

Its own answer reads the scenes of `tests/helpers/nuscenes_movers.py`: points whose intensity is 20
times the number of their object plus its class. Where an object is at the keyframe, and how it
moves, it fits to the points and their time lags. The surer the more sweeps show the object.
"""

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import torch
import yaml

NAMES = ["car", "truck", "bus", "bicycle", "pedestrian", "barrier"]
REACH = [-200.0, -200.0, -5.0, 200.0, 200.0, 5.0]
CONFIG = {"CLASS_NAMES": NAMES, "DATA_CONFIG": {"POINT_CLOUD_RANGE": REACH}, "MODEL": {}}
SIZES = np.array(
    [[4.6, 1.9, 1.7], [7.0, 2.5, 2.9], [11.0, 2.9, 3.4], [1.8, 0.6, 1.4], [0.7, 0.7, 1.8]]
)


def answer(points):
    """Boxes (n, 9), labels from 1, scores, to points of x (right), y (ahead), z, intensity up to
    255, time lag: one box per object, and one barrier, which is of no use here.
    """
    points = points.numpy()
    codes = np.rint(points[:, 3]).astype(int)
    rows = [_box(points[codes == code], code % 20) for code in np.unique(codes)]
    rows = [*rows, np.r_[np.zeros(3), np.ones(3), np.zeros(3), 5, 0.5]]
    found = torch.tensor(np.array(rows))
    return found[:, :9], found[:, 9].long() + 1, found[:, 10]


def _box(points, label):
    # Places as a line over time since the keyframe, which is below 0.
    times, places = -points[:, 4].astype(float), points[:, :3].astype(float)
    off = times - times.mean()
    sweeps = len({*times.round(3).tolist()})
    moves = off @ places / (off @ off) if sweeps > 1 else np.zeros(3)
    centre = places.mean(axis=0) - times.mean() * moves
    yaw = np.arctan2(moves[1], moves[0])
    return np.r_[centre, SIZES[label], yaw, moves[:2], label, 0.4 + sweeps / 20]


class Network(torch.nn.Module):
    """Has no weights."""

    def load_params_from_file(self, checkpoint, logger, to_cpu):
        """Need the file alone."""
        assert to_cpu
        with open(checkpoint):
            pass

    def forward(self, batch):
        """One sample."""
        assert batch["batch_size"] == 1
        # The first column numbers the sample.
        keys = ("pred_boxes", "pred_labels", "pred_scores")
        return [dict(zip(keys, answer(batch["points"][:, 1:]), strict=True))], {}


class DatasetTemplate:
    """Shuffles the points; a scan without one in reach has no voxels."""

    def __init__(self, config, names, training, logger):
        assert not training
        self.point_cloud_range = np.array(config["POINT_CLOUD_RANGE"], np.float32)

    def prepare_data(self, given):
        """One sample."""
        points = given["points"]
        assert (np.abs(points[:, :2]) < self.point_cloud_range[3]).any()
        return given | {"points": points[np.random.permutation(len(points))]}  # noqa: NPY002

    def collate_batch(self, given):
        """A batch of one."""
        (one,) = given
        points = one["points"]
        numbered = np.column_stack([np.zeros(len(points)), points])
        return {"points": numbered, "frame_id": np.array([0]), "batch_size": 1}


class Settings(dict):
    """Settings with the interface of EasyDict."""

    def __getattr__(self, name):
        if name in self:
            return self[name]
        raise AttributeError(name)


def merge_new_config(config, new_config):
    """A base comes from the current folder."""
    if "_BASE_CONFIG_" in new_config:
        config.update(yaml.safe_load(Path(new_config["_BASE_CONFIG_"]).read_text()))
    for key, value in new_config.items():
        if isinstance(value, dict):
            config[key] = merge_new_config(config.get(key, Settings()), value)
        else:
            config[key] = value
    return config


def _module(name, **own):
    module = sys.modules[f"{__name__}.{name}"] = ModuleType(f"{__name__}.{name}")
    vars(module).update(own)


_module("config", cfg=Settings(ROOT_DIR=Path("nowhere")), merge_new_config=merge_new_config)
_module("datasets", DatasetTemplate=DatasetTemplate)
_module("models", build_network=lambda *_, **__: Network())
_module("utils", common_utils=SimpleNamespace(create_logger=lambda: None))
