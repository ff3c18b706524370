"""A detector of OpenPCDet (https://github.com/open-mmlab/OpenPCDet).

care-sim protocol --source nuscenes:FOLDER --sweeps 10 --detector openpcdet_detector:OpenPCDet \
        --detector-parameters config=cbgs_voxel0075_centerpoint.yaml checkpoint=centerpoint.pth
"""

import numpy as np

from care_sim.perception.network_detectors import NetworkDetector


class OpenPCDet(NetworkDetector):
    """Runs a network of OpenPCDet that was trained on nuScenes, on the device `device`."""

    sweeps = 10  # in the closed loop, where a keyframe has one sweep of its own
    track_score = 0.3

    def __init__(self, config: str, checkpoint: str, device: str = "cuda:0"):
        import torch
        from pcdet.config import cfg, cfg_from_yaml_file
        from pcdet.datasets import DatasetTemplate
        from pcdet.models import build_network, load_data_to_gpu
        from pcdet.utils import common_utils

        settings = cfg_from_yaml_file(config, cfg)
        # OpenPCDet turns the sweeps of nuScenes neither for training nor for tests: x is right.
        super().__init__(
            fields=("x", "y", "z", "intensity", "time_lag"),
            axes="right",
            full_intensity=255,
            classes=settings.CLASS_NAMES,
        )
        logger = common_utils.create_logger()
        self._torch, self._to_gpu, self._device = torch, load_data_to_gpu, torch.device(device)
        self._data = DatasetTemplate(
            settings.DATA_CONFIG, settings.CLASS_NAMES, training=False, logger=logger
        )
        self._network = build_network(
            settings.MODEL, num_class=len(settings.CLASS_NAMES), dataset=self._data
        )
        on_cpu = self._device.type == "cpu"
        self._network.load_params_from_file(checkpoint, logger=logger, to_cpu=on_cpu)
        self._network.to(self._device).eval()

    def detect(self, points, sensor_height_m):
        """See `care_sim.perception.points_only.PointDetector`."""
        given = {"points": self.points_for(points), "frame_id": 0}
        batch = self._data.collate_batch([self._data.prepare_data(given)])
        with self._torch.inference_mode():
            self._to_gpu(batch)
            (found,), _ = self._network(batch)
        boxes = found["pred_boxes"].cpu().numpy()
        # Labels count from 1. Networks of nuScenes answer velocities behind the yaw.
        labels = found["pred_labels"].cpu().numpy() - 1
        scores = np.clip(found["pred_scores"].cpu().numpy(), 0, 1)
        velocities = boxes[:, 7:9] if boxes.shape[1] >= 9 else None
        return self.detections(points, labels, boxes[:, :7], scores, velocities)
