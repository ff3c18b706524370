"""A detector of OpenPCDet (https://github.com/open-mmlab/OpenPCDet).

care-sim protocol --source nuscenes:FOLDER --detector openpcdet_detector:OpenPCDet \
        --detector-parameters config=cbgs_voxel0075_centerpoint.yaml checkpoint=centerpoint.pth
"""

from contextlib import nullcontext
from copy import deepcopy
from pathlib import Path
from threading import Lock

import numpy as np

from care_sim.perception.network_detectors import NetworkDetector, has_point_in


class OpenPCDet(NetworkDetector):
    """Runs a network of OpenPCDet.

    Unless given, `device` is cuda:0 where there is one, else cpu, and `fields`, `axes` and
    `full_intensity`, those of `NetworkDetector`, are as in training on nuScenes.
    """

    sweeps = 10  # for a network of fewer: --detector-parameters sweeps=1
    track_score = 0.3
    stateless = True
    # One for all detectors, which share the generator of NumPy.
    _lock = Lock()

    def __init__(
        self,
        config: str,
        checkpoint: str,
        device: str = "",
        fields: str = "x,y,z,intensity,time_lag",
        # OpenPCDet turns the sweeps of nuScenes neither for training nor for tests: x is right.
        axes: str = "right",
        full_intensity: float = 255,
    ):
        import torch
        from pcdet.datasets import DatasetTemplate
        from pcdet.models import build_network
        from pcdet.utils import common_utils

        device = device or ("cuda:0" if torch.cuda.is_available() else "cpu")
        settings, self.files = settings_of(config)
        names = settings.CLASS_NAMES
        super().__init__(fields, axes, full_intensity, names)
        logger = common_utils.create_logger()
        self._torch, self._device = torch, torch.device(device)
        self._data = DatasetTemplate(settings.DATA_CONFIG, names, training=False, logger=logger)
        # Its layers put tables on the current device.
        with self._on_device():
            network = build_network(settings.MODEL, num_class=len(names), dataset=self._data)
            network.load_params_from_file(checkpoint, logger=logger, to_cpu=True)
            self._network = network.to(self._device).eval()

    def detect(self, points, sensor_height_m):
        """See `care_sim.perception.points_only.PointDetector`."""
        own = self.points_for(points)
        if not has_point_in(self._data.point_cloud_range, own):
            return self.detections(points, [], [], [])  # no voxel holds a point
        # Layers keep what they computed last, and the device is that of the thread.
        with self._lock, self._on_device(), self._torch.inference_mode():
            (found,), _ = self._network(self._batch(own))
        boxes = found["pred_boxes"].cpu().numpy()
        # Labels count from 1. Networks of nuScenes answer velocities behind the yaw.
        labels = found["pred_labels"].cpu().numpy() - 1
        scores = np.clip(found["pred_scores"].cpu().numpy(), 0, 1)
        velocities = boxes[:, 7:9] if boxes.shape[1] >= 9 else None
        return self.detections(points, labels, boxes[:, :7], scores, velocities)

    def _batch(self, points):
        # OpenPCDet shuffles the points of nuScenes in tests, too, and a full voxel drops the last.
        drawn = np.random.get_state()  # noqa: NPY002 (its generator)
        np.random.seed(0)  # noqa: NPY002
        try:
            ready = self._data.prepare_data({"points": points, "frame_id": 0})
        finally:
            np.random.set_state(drawn)  # noqa: NPY002
        batch = self._data.collate_batch([ready])
        # Not by its load_data_to_gpu, which knows one device.
        return {
            key: self._torch.from_numpy(value).float().to(self._device)
            if isinstance(value, np.ndarray) and key != "frame_id"
            else value
            for key, value in batch.items()
        }

    def _on_device(self):
        on_gpu = self._device.type == "cuda"
        return self._torch.cuda.device(self._device) if on_gpu else nullcontext()


def settings_of(config):
    """The settings of a file, and the files that it is built upon.

    OpenPCDet looks for a `_BASE_CONFIG_` in its folder tools, where its own programs run. Here it
    is looked for in the current folder, in those above the file, and in tools.
    """
    import yaml
    from pcdet.config import cfg, merge_new_config

    path = Path(config).resolve()
    folders = [Path.cwd(), *path.parents, Path(cfg.ROOT_DIR) / "tools"]

    bases = []

    def placed(told):
        if not isinstance(told, dict):
            return told
        own = {key: placed(value) for key, value in told.items()}
        if base := own.get("_BASE_CONFIG_"):
            found = (folder / base for folder in folders if (folder / base).is_file())
            bases.append(next(found, Path(base)))
            own["_BASE_CONFIG_"] = str(bases[-1])
        return own

    # A copy: two detectors of a process may have two configs.
    return merge_new_config(deepcopy(cfg), placed(yaml.safe_load(path.read_text()))), bases
