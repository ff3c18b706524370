"""Networks of anybody's: their columns, axes, labels and velocities, from TorchScript and ONNX."""

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.types import CLASSES
from care_sim.perception.detectors import make_detector
from care_sim.perception.network_detectors import NetworkDetector, TorchScriptDetector
from care_sim.sensors.annotated import NO_ANNOTATIONS, NO_OBJECT, Cloud
from tests.helpers.network_files import drawing_script, interface_script
from tests.helpers.places import ROOT, fenced, loaded

NUSCENES = "car,truck,construction_vehicle,bus,trailer,barrier,motorcycle,bicycle,pedestrian"
POINTS = np.array([[10.0, 2.0, -1.0, 0.5, 0.1], [10.5, 2.0, -1.0, 0.25, 0.2]])


def network(**told):
    own = {"fields": "x,y,z,intensity,time_lag", "axes": "right", "full_intensity": 255.0}
    return NetworkDetector(**own | {"classes": NUSCENES} | told)


def test_points_come_in_the_axes_and_units_of_the_training():
    # nuScenes: x right, y forward, intensities to 255.
    given = network().points_for(POINTS)
    assert given.dtype == np.float32
    assert given[0].tolist() == pytest.approx([-2.0, 10.0, -1.0, 127.5, 0.1])
    assert POINTS[0, 0] == 10.0


def test_answers_come_back_in_our_axes_and_classes():
    # A pedestrian who stands ahead, left of the middle, and walks right; and a barrier.
    boxes = np.array([[-2.0, 10.0, -1.0, 3.0, 1.0, 2.0, np.pi / 2], [0, 0, 0, 1, 1, 1, 0]])
    moves = np.array([[1.5, 0.0], [0.0, 0.0]])
    found = network().detections(POINTS, [8, 5], boxes, [0.9, 0.8], moves)
    assert [CLASSES[label] for label in found.classes] == ["pedestrian"]
    assert found.boxes[0].tolist() == pytest.approx([10.0, 2.0, -1.0, 3.0, 1.0, 2.0, 0.0])
    assert found.velocities.tolist() == [[0.0, -1.5]]
    assert found.returns.tolist() == [2]
    assert found.scores.tolist() == [0.9]


def test_turned_axes_are_undone():
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.normal(size=(9, 3)), np.zeros((9, 2))])
    boxes = np.column_stack([network().points_for(points)[:, :3], np.ones((9, 3)), np.zeros(9)])
    found = network().detections(points, [0] * 9, boxes, np.ones(9))
    assert found.boxes[:, :3] == pytest.approx(points[:, :3], abs=1e-6)


@pytest.mark.parametrize(
    ("told", "fault"),
    [
        ({"fields": "x,y,z,colour"}, "unknown field 'colour'"),
        ({"axes": "up"}, "unknown axes 'up'"),
        ({"classes": "tree,dog"}, "classes must name one of car, truck"),
        ({"full_intensity": -1}, "full_intensity"),
    ],
)
def test_conventions_that_are_none_are_named(told, fault):
    with pytest.raises(InvalidInput, match=fault):
        network(**told)


def test_a_label_beyond_the_classes_is_named():
    with pytest.raises(
        InvalidInput, match="answers the labels 9 to 9, and its classes have 0 to 8"
    ):
        network().detections(POINTS, [9], np.ones((1, 7)), [1.0])


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_a_module_that_cannot_be_frozen_runs_and_is_not_shared(tmp_path):
    pytest.importorskip("torch")
    detector = TorchScriptDetector(interface_script(tmp_path / "net.pt"))
    assert not detector.stateless
    assert detector.detect(POINTS[:, :3], 1.0).boxes[0, 0] == 10.0


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
@pytest.mark.parametrize("forked", [False, True])
def test_a_module_that_draws_draws_the_same_and_disturbs_nobody(forked, tmp_path):
    torch = pytest.importorskip("torch")
    detector = TorchScriptDetector(drawing_script(tmp_path / "net.pt", forked))
    assert detector.stateless != forked
    torch.manual_seed(7)
    places = [detector.detect(POINTS[:, :3], 1.0).boxes[0, 0]]
    drawn = torch.rand(1)
    torch.manual_seed(7)
    assert torch.rand(1) == drawn
    places.append(detector.detect(POINTS[:, :3], 1.0).boxes[0, 0])
    assert places[0] == places[1] != 0


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_a_module_without_forward_is_named_in_one_line(tmp_path):
    torch = pytest.importorskip("torch")
    torch.jit.script(torch.nn.Module()).save(str(tmp_path / "net.pt"))
    with pytest.raises(InvalidInput, match=r"net\.pt: the module has no method forward\("):
        TorchScriptDetector(tmp_path / "net.pt")
    with pytest.raises(InvalidInput, match="device gpu is not here"):
        TorchScriptDetector(tmp_path / "net.pt", device="gpu")


def test_what_says_how_a_network_is_fed_is_among_what_is_known():
    with pytest.raises(InvalidInput, match=r"track_scor'.*sweeps, track_score"):
        make_detector("torchscript", 1.8, file="net.pt", track_scor=0.3)


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_the_network_of_the_page_is_a_detector(tmp_path, monkeypatch):
    pytest.importorskip("torch")
    block, *_ = fenced(ROOT / "docs" / "write" / "your-detector.md", "py")
    (tmp_path / "export.py").write_text(block)
    monkeypatch.chdir(tmp_path)
    loaded(tmp_path / "export.py")
    detector = make_detector("torchscript", 1.8, file="net.pt")
    road, high = [4.0, 0.0, -1.8], [10.2, 2.6, -0.5]
    cloud = Cloud(np.arange(3), np.array([road, high, high]), np.full(3, NO_OBJECT))
    found, _ = detector.detect(cloud, NO_ANNOTATIONS)
    assert [CLASSES[label] for label in found.classes] == ["pedestrian"]
    assert found.boxes[0] == pytest.approx([10.5, 2.5, -0.9, 0.7, 0.7, 1.8, 0.0])
    assert found.scores == pytest.approx([0.1])
    assert len(detector.detect(cloud.take(np.zeros(3, bool)), NO_ANNOTATIONS)[0]) == 0
