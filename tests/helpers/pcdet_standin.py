"""A small network in the interface of OpenPCDet, which does not install where tests run. The test
that uses it puts this file in place of the package `pcdet`.

It reads the scenes of `tests/helpers/nuscenes_movers.py`: points whose intensity is 20 times the
number of their object plus its class. Where an object is at the keyframe, and how it moves, it
fits to the points and their time lags. The surer the more sweeps show the object.
"""

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import torch

NAMES = ["car", "truck", "bus", "bicycle", "pedestrian", "barrier"]
SIZES = np.array(
    [[4.6, 1.9, 1.7], [7.0, 2.5, 2.9], [11.0, 2.9, 3.4], [1.8, 0.6, 1.4], [0.7, 0.7, 1.8]]
)


class Network(torch.nn.Module):
    """Reads x (right), y (ahead), z, intensity up to 255, time lag."""

    def load_params_from_file(self, checkpoint, logger, to_cpu):
        """Need no weights, but the file."""
        with open(checkpoint):
            pass

    def forward(self, batch):
        """One box per object, and one barrier, which is of no use here."""
        points = batch["points"][:, 1:].numpy()
        codes = np.rint(points[:, 3]).astype(int)
        rows = [self._box(points[codes == code], code % 20) for code in np.unique(codes)]
        rows = [*rows, np.r_[np.zeros(3), np.ones(3), np.zeros(3), 5, 0.5]]
        found = torch.tensor(np.array(rows))
        answers = {"pred_boxes": found[:, :9], "pred_labels": found[:, 9].long() + 1}
        return [answers | {"pred_scores": found[:, 10]}], {}

    def _box(self, points, label):
        # Places as a line over time since the keyframe, which is below 0.
        times, places = -points[:, 4].astype(float), points[:, :3].astype(float)
        off = times - times.mean()
        sweeps = len({*times.round(3).tolist()})
        moves = off @ places / (off @ off) if sweeps > 1 else np.zeros(3)
        centre = places.mean(axis=0) - times.mean() * moves
        yaw = np.arctan2(moves[1], moves[0])
        return np.r_[centre, SIZES[label], yaw, moves[:2], label, 0.4 + sweeps / 20]


class DatasetTemplate:
    """Leaves the points as they are."""

    def __init__(self, config, names, training, logger):
        pass

    def prepare_data(self, given):
        """One sample."""
        return given

    def collate_batch(self, given):
        """A batch of one; the first column numbers the sample."""
        (one,) = given
        points = one["points"]
        return {"points": np.column_stack([np.zeros(len(points)), points]), "batch_size": 1}


def load_data_to_gpu(batch):
    """Where there is none."""
    batch["points"] = torch.from_numpy(batch["points"])


def _module(name, **own):
    module = sys.modules[f"{__name__}.{name}"] = ModuleType(f"{__name__}.{name}")
    vars(module).update(own)
    return module


SETTINGS = SimpleNamespace(CLASS_NAMES=NAMES, DATA_CONFIG={}, MODEL={})
_module("config", cfg=None, cfg_from_yaml_file=lambda file, cfg: SETTINGS)
_module("datasets", DatasetTemplate=DatasetTemplate)
_module("models", build_network=lambda *_, **__: Network(), load_data_to_gpu=load_data_to_gpu)
_module("utils", common_utils=SimpleNamespace(create_logger=lambda: None))
