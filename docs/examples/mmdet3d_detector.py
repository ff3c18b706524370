"""A detector of mmdetection3d 1.x (https://github.com/open-mmlab/mmdetection3d).

care-sim protocol --source nuscenes:FOLDER --detector mmdet3d_detector:MMDet3D \
        --detector-parameters config=centerpoint_voxel0075_nus.py checkpoint=centerpoint.pth
"""

import ast
from contextlib import nullcontext
from pathlib import Path
from threading import Lock

import numpy as np

from care_sim.perception.network_detectors import NetworkDetector, has_point_in


class MMDet3D(NetworkDetector):
    """Runs a network of mmdetection3d.

    Unless given, `device` is cuda:0 where there is one, else cpu, and `fields`, `axes` and
    `full_intensity`, those of `NetworkDetector`, are as in training on nuScenes.
    """

    sweeps = 10  # for a network of fewer: --detector-parameters sweeps=1
    track_score = 0.3
    stateless = True

    def __init__(
        self,
        config: str,
        checkpoint: str,
        device: str = "",
        fields: str = "x,y,z,intensity,time_lag",
        axes: str = "right",
        full_intensity: float = 255,
    ):
        import torch
        from mmdet3d.apis import init_model
        from mmdet3d.structures import Det3DDataSample, LiDARInstance3DBoxes

        device = device or ("cuda:0" if torch.cuda.is_available() else "cpu")
        self._torch, self._sample, self._boxes = torch, Det3DDataSample, LiDARInstance3DBoxes
        self._network = init_model(config, checkpoint, device=device)
        self.files = bases_of(Path(config))
        self._device, self._lock = torch.device(device), Lock()
        # Networks without voxels have no range.
        voxels = getattr(self._network.data_preprocessor, "voxel_layer", None)
        self._range = getattr(voxels, "point_cloud_range", [-np.inf] * 3 + [np.inf] * 3)
        super().__init__(fields, axes, full_intensity, self._network.dataset_meta["classes"])

    def detect(self, points, sensor_height_m):
        """See `care_sim.perception.points_only.PointDetector`."""
        own = self.points_for(points)
        if not has_point_in(self._range, own):
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


def bases_of(config):
    """The files that a config is built upon: those of `_base_` in Python files, and theirs."""
    found = []
    text = config.read_text() if config.suffix == ".py" else ""
    for line in ast.parse(text).body:
        if isinstance(line, ast.Assign) and ast.unparse(line.targets[0]) == "_base_":
            names = ast.literal_eval(line.value)
            for name in [names] if isinstance(names, str) else names:
                # A name with a scope, as mmdet3d::..., belongs to the installed framework.
                if "::" not in name:
                    base = config.absolute().parent / name
                    found += [base, *bases_of(base)]
    return found
