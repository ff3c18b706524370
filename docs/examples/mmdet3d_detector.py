"""A detector of mmdetection3d 1.x (https://github.com/open-mmlab/mmdetection3d).

care-sim protocol --source nuscenes:FOLDER --sweeps 10 --detector mmdet3d_detector:MMDet3D \
        --detector-parameters config=centerpoint_voxel0075_nus.py checkpoint=centerpoint.pth
"""

import numpy as np

from care_sim.perception.network_detectors import NetworkDetector


class MMDet3D(NetworkDetector):
    """Runs a network of mmdetection3d that was trained on nuScenes, on the device `device`."""

    sweeps = 10  # in the closed loop, where a keyframe has one sweep of its own
    track_score = 0.3

    def __init__(self, config: str, checkpoint: str, device: str = "cuda:0"):
        import torch
        from mmdet3d.apis import init_model
        from mmdet3d.structures import Det3DDataSample, LiDARInstance3DBoxes

        self._torch, self._sample, self._boxes = torch, Det3DDataSample, LiDARInstance3DBoxes
        self._network = init_model(config, checkpoint, device=device)
        self._device = device
        super().__init__(
            fields=("x", "y", "z", "intensity", "time_lag"),
            axes="right",
            full_intensity=255,
            classes=self._network.dataset_meta["classes"],
        )

    def detect(self, points, sensor_height_m):
        """See `care_sim.perception.points_only.PointDetector`."""
        # The pipeline of the config would read files; the points are here already.
        given = self._torch.from_numpy(self.points_for(points)).to(self._device)
        sample = self._sample(metainfo={"box_type_3d": self._boxes})
        with self._torch.inference_mode():
            (answer,) = self._network.test_step(
                {"inputs": {"points": [given]}, "data_samples": [sample]}
            )
        found = answer.pred_instances_3d
        boxes = found.bboxes_3d.tensor.cpu().numpy()
        # Boxes of mmdetection3d stand on their z; ours have their centre there.
        boxes[:, 2] += boxes[:, 5] / 2
        labels = found.labels_3d.cpu().numpy()
        scores = np.clip(found.scores_3d.cpu().numpy(), 0, 1)
        velocities = boxes[:, 7:9] if boxes.shape[1] >= 9 else None
        return self.detections(points, labels, boxes[:, :7], scores, velocities)
