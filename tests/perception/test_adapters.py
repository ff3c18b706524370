"""The adapters of the documentation, each with a small network in the interface of its framework:
neither OpenPCDet nor mmdetection3d can be installed where these tests run.
"""

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from care_sim.core.types import CLASSES
from care_sim.perception.points_only import PointsOnly
from care_sim.sensors.annotated import NO_ANNOTATIONS, Cloud
from tests.helpers.places import EXAMPLES, loaded

torch = pytest.importorskip("torch")

NAMES = ["car", "truck", "barrier", "pedestrian"]
CLOUD = Cloud(
    np.array([3, 4]),
    np.array([[10.0, 2.0, -1.0], [10.2, 2.0, -1.0]]),
    np.array([7, 7]),
    intensities=np.array([0.5, 0.5]),
    times=np.array([0.0, -0.1]),
)


def answer(points, z):
    """A pedestrian where the points are, who walks along the axis of its yaw, and a barrier."""
    assert points.shape == (2, 5)
    x, y = points[:, :2].mean(0).tolist()
    # x right, y forward; a full intensity of 255; the time lag above 0.
    assert (x, y) == pytest.approx((-2.0, 10.1))
    assert points[:, 3].tolist() == [127.5, 127.5]
    assert sorted(points[:, 4].tolist()) == pytest.approx([0.0, 0.1])
    return torch.tensor(
        [[x, y, z, 0.6, 0.6, 1.8, np.pi / 2, 0.0, 1.5], [0, 0, 0, 1, 1, 1, 0, 0, 0]]
    )


def modules(monkeypatch, **contents):
    for name, own in contents.items():
        parts = name.split("__")
        for end in range(1, len(parts) + 1):
            place = ".".join(parts[:end])
            if place not in sys.modules:
                monkeypatch.setitem(sys.modules, place, ModuleType(place))
        for key, value in own.items():
            monkeypatch.setattr(sys.modules[".".join(parts)], key, value, raising=False)


def pcdet(monkeypatch):
    class Network(torch.nn.Module):
        def load_params_from_file(self, checkpoint, logger, to_cpu):
            assert (checkpoint, to_cpu) == ("net.pth", True)

        def forward(self, batch):
            boxes = answer(batch["points"][:, 1:], -1.0)
            labels, scores = torch.tensor([4, 3]), torch.tensor([0.9, 0.8])
            return [{"pred_boxes": boxes, "pred_labels": labels, "pred_scores": scores}], {}

    class Data:
        def __init__(self, config, names, training, logger):
            assert (names, training) == (NAMES, False)

        def prepare_data(self, given):
            return given

        def collate_batch(self, given):
            (one,) = given
            points = one["points"]
            return {"points": np.column_stack([np.zeros(len(points)), points]), "batch_size": 1}

    def to_gpu(batch):
        batch["points"] = torch.from_numpy(batch["points"]).float()

    settings = SimpleNamespace(CLASS_NAMES=NAMES, DATA_CONFIG={}, MODEL={})
    modules(
        monkeypatch,
        pcdet__config={"cfg": None, "cfg_from_yaml_file": lambda file, cfg: settings},
        pcdet__datasets={"DatasetTemplate": Data},
        pcdet__models={"build_network": lambda *_, **__: Network(), "load_data_to_gpu": to_gpu},
        pcdet__utils__common_utils={"create_logger": lambda: None},
    )
    monkeypatch.setattr(
        sys.modules["pcdet.utils"], "common_utils", sys.modules["pcdet.utils.common_utils"],
        raising=False,
    )  # fmt: skip
    return loaded(EXAMPLES / "openpcdet_detector.py").OpenPCDet("net.yaml", "net.pth", "cpu")


def mmdet3d(monkeypatch):
    class Network:
        dataset_meta = {"classes": tuple(NAMES)}  # noqa: RUF012 (as the framework has it)

        def test_step(self, data):
            (points,), (sample,) = data["inputs"]["points"], data["data_samples"]
            assert sample.metainfo == {"box_type_3d": "boxes"}
            boxes = answer(points, -1.9)
            found = SimpleNamespace(
                bboxes_3d=SimpleNamespace(tensor=boxes),
                labels_3d=torch.tensor([3, 2]),
                scores_3d=torch.tensor([0.9, 0.8]),
            )
            return [SimpleNamespace(pred_instances_3d=found)]

    modules(
        monkeypatch,
        mmdet3d__apis={"init_model": lambda config, checkpoint, device: Network()},
        mmdet3d__structures={
            "Det3DDataSample": lambda metainfo: SimpleNamespace(metainfo=metainfo),
            "LiDARInstance3DBoxes": "boxes",
        },
    )
    return loaded(EXAMPLES / "mmdet3d_detector.py").MMDet3D("net.py", "net.pth", "cpu")


@pytest.mark.parametrize("made", [pcdet, mmdet3d])
def test_a_framework_gets_its_columns_and_its_boxes_come_back(made, monkeypatch):
    detector = PointsOnly("theirs", made(monkeypatch), 1.84)
    assert (detector.gathers, detector.track_score) == (10, 0.3)
    found, objects = detector.detect(CLOUD, NO_ANNOTATIONS)
    assert [CLASSES[label] for label in found.classes] == ["pedestrian"]
    # In our axes the pedestrian looks and walks ahead.
    assert found.boxes[0] == pytest.approx([10.1, 2.0, -1.0, 0.6, 0.6, 1.8, 0.0], abs=1e-6)
    assert found.velocities[0] == pytest.approx([1.5, 0.0], abs=1e-6)
    assert found.scores.tolist() == pytest.approx([0.9])
    assert objects.tolist() == [7]
