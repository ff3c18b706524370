"""A detector of mmdetection3d 1.x (https://github.com/open-mmlab/mmdetection3d).

care-sim protocol --source nuscenes:FOLDER --detector mmdet3d_detector:MMDet3D \
        --detector-parameters config=centerpoint_voxel0075_nus.py checkpoint=centerpoint.pth
"""

from contextlib import nullcontext
from threading import Lock

import numpy as np

from care_sim.perception.network_detectors import NetworkDetector


class MMDet3D(NetworkDetector):
    """Runs a network of mmdetection3d on the device `device`. `fields`, `axes` and `full_intensity`
    are those of `NetworkDetector`, and as in training on nuScenes unless given.
    """

    sweeps = 10  # for a network of fewer: --detector-parameters sweeps=1
    track_score = 0.3
    stateless = True

    def __init__(
        self,
        config: str,
        checkpoint: str,
        device: str = "cuda:0",
        fields: str = "x,y,z,intensity,time_lag",
        axes: str = "right",
        full_intensity: float = 255,
    ):
        import torch
        from mmdet3d.apis import init_model
        from mmdet3d.structures import Det3DDataSample, LiDARInstance3DBoxes

        self._torch, self._sample, self._boxes = torch, Det3DDataSample, LiDARInstance3DBoxes
        self._network = init_model(config, checkpoint, device=device)
        self._device, self._lock = torch.device(device), Lock()
        # Networks without voxels have no range.
        voxels = getattr(self._network.data_preprocessor, "voxel_layer", None)
        self._range = getattr(voxels, "point_cloud_range", [-np.inf] * 3 + [np.inf] * 3)
        super().__init__(fields, axes, full_intensity, self._network.dataset_meta["classes"])

    def detect(self, points, sensor_height_m):
        """See `care_sim.perception.points_only.PointDetector`."""
        own = self.points_for(points)
        low, high = np.split(np.asarray(self._range, float), 2)
        if not np.all((own[:, :3] >= low) & (own[:, :3] < high), axis=1).any():
            return self.detections(points, [], [], [])  # no voxel holds a point
        # The pipeline of the config would read files; the points are here already.
        given = self._torch.from_numpy(own).to(self._device)
        sample = self._sample(metainfo={"box_type_3d": self._boxes})
        batch = {"inputs": {"points": [given]}, "data_samples": [sample]}
        on_gpu = self._device.type == "cuda"
        device = self._torch.cuda.device(self._device) if on_gpu else nullcontext()
        # Layers keep what they computed last, and the device is that of the thread.
        with self._lock, device, self._torch.inference_mode():
            (answer,) = self._network.test_step(batch)
        found = answer.pred_instances_3d
        boxes = found.bboxes_3d.tensor.cpu().numpy()
        # Boxes of mmdetection3d stand on their z; ours have their centre there.
        boxes[:, 2] += boxes[:, 5] / 2
        labels = found.labels_3d.cpu().numpy()
        scores = np.clip(found.scores_3d.cpu().numpy(), 0, 1)
        velocities = boxes[:, 7:9] if boxes.shape[1] >= 9 else None
        return self.detections(points, labels, boxes[:, :7], scores, velocities)
