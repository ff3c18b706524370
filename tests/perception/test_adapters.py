"""The adapters of the documentation, each with a small network in the interface of its framework:
neither OpenPCDet nor mmdetection3d can be installed where these tests run.
"""

import sys
from contextlib import contextmanager, nullcontext
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from care_sim.core.types import CLASSES
from care_sim.perception.points_only import PointsOnly
from care_sim.sensors.annotated import NO_ANNOTATIONS, Cloud
from tests.helpers.places import EXAMPLES, ROOT, loaded

torch = pytest.importorskip("torch")

yaml = pytest.importorskip("yaml")

NAMES = ["car", "truck", "barrier", "pedestrian"]
RANGE = [-51.2, -51.2, -5.0, 51.2, 51.2, 3.0]
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


def pcdet(monkeypatch, answers=answer):
    place = spec_from_file_location("pcdet", ROOT / "tests" / "helpers" / "pcdet_standin.py")
    standin = module_from_spec(place)
    monkeypatch.setitem(sys.modules, "pcdet", standin)
    place.loader.exec_module(standin)
    labels, scores = torch.tensor([4, 3]), torch.tensor([0.9, 0.8])
    standin.answer = lambda points: (answers(points, -1.0), labels, scores)
    return loaded(EXAMPLES / "openpcdet_detector.py").OpenPCDet


def mmdet3d(monkeypatch, answers=answer):
    class Network:
        dataset_meta = {"classes": tuple(NAMES)}  # noqa: RUF012 (as the framework has it)
        data_preprocessor = SimpleNamespace(voxel_layer=SimpleNamespace(point_cloud_range=RANGE))

        def test_step(self, data):
            (points,), (sample,) = data["inputs"]["points"], data["data_samples"]
            assert sample.metainfo == {"box_type_3d": "boxes"}
            boxes = answers(points, -1.9)
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
    return loaded(EXAMPLES / "mmdet3d_detector.py").MMDet3D


FRAMEWORKS = [pcdet, mmdet3d]
BASE = "cfgs/dataset_configs/nuscenes.yaml"


@pytest.fixture
def config(tmp_path, monkeypatch):
    """The configuration of a network, in a folder as that of OpenPCDet, with the weights in the
    current folder.
    """
    monkeypatch.chdir(tmp_path)
    Path("net.pth").touch()
    base = tmp_path / "tools" / BASE
    own = tmp_path / "tools" / "cfgs" / "models" / "net.yaml"
    for file in (base, own):
        file.parent.mkdir(parents=True)
    base.write_text(yaml.safe_dump({"POINT_CLOUD_RANGE": RANGE}))
    told = {"CLASS_NAMES": NAMES, "DATA_CONFIG": {"_BASE_CONFIG_": BASE}, "MODEL": {}}
    own.write_text(yaml.safe_dump(told))
    return str(own)


@pytest.mark.parametrize("framework", FRAMEWORKS)
def test_a_framework_gets_its_columns_and_its_boxes_come_back(framework, config, monkeypatch):
    made = framework(monkeypatch)(config, "net.pth", "cpu")
    detector = PointsOnly("theirs", made, 1.84)
    assert (detector.gathers, detector.track_score) == (10, 0.3)
    found, objects = detector.detect(CLOUD, NO_ANNOTATIONS)
    assert [CLASSES[label] for label in found.classes] == ["pedestrian"]
    # In our axes the pedestrian looks and walks ahead.
    assert found.boxes[0] == pytest.approx([10.1, 2.0, -1.0, 0.6, 0.6, 1.8, 0.0], abs=1e-6)
    assert found.velocities[0] == pytest.approx([1.5, 0.0], abs=1e-6)
    assert found.scores.tolist() == pytest.approx([0.9])
    assert objects.tolist() == [7]


def first_point(points, z):
    """A box of the size of the first point's place, and another."""
    seen.append(points.clone())
    x, y, *_ = points[0].tolist()
    return torch.tensor([[x, y, z, 0.6, 0.6, 1.8, 0.0], [0, 0, 0, 1, 1, 1, 0]])


seen = []


@pytest.mark.parametrize("framework", FRAMEWORKS)
def test_a_network_may_have_columns_and_axes_of_its_own(framework, config, monkeypatch):
    kind = framework(monkeypatch, first_point)
    own = {"fields": "x,y,z,intensity", "axes": "forward", "full_intensity": 1}
    made = kind(config, "net.pth", "cpu", **own)
    PointsOnly("theirs", made, 1.84).detect(CLOUD, NO_ANNOTATIONS)
    assert sorted(seen[-1].tolist()) == [
        pytest.approx([10.0, 2.0, -1.0, 0.5]),
        pytest.approx([10.2, 2.0, -1.0, 0.5]),
    ]


@pytest.mark.parametrize("framework", FRAMEWORKS)
@pytest.mark.parametrize("places", [[], [[80.0, 0.0, -1.0]], [[10.0, 0.0, 9.0]]])
def test_a_scan_without_a_point_in_reach_asks_nobody(framework, places, config, monkeypatch):
    made = framework(monkeypatch, None)(config, "net.pth", "cpu")
    cells = np.arange(len(places))
    cloud = Cloud(cells, np.array(places).reshape(-1, 3), cells)
    found, _ = PointsOnly("theirs", made, 1.84).detect(cloud, NO_ANNOTATIONS)
    assert len(found) == 0


@pytest.mark.parametrize("framework", FRAMEWORKS)
@pytest.mark.parametrize("there_is_one", [True, False])
def test_the_device_is_a_gpu_where_there_is_one(framework, there_is_one, config, monkeypatch):
    kind = framework(monkeypatch)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: there_is_one)
    monkeypatch.setattr(torch.cuda, "device", lambda _: nullcontext())
    monkeypatch.setattr(torch.nn.Module, "to", lambda self, _: self)
    made = kind(config, "net.pth")
    assert str(made._device) == ("cuda:0" if there_is_one else "cpu")


def test_adapters_say_what_their_configs_are_built_upon(config, monkeypatch, tmp_path):
    made = pcdet(monkeypatch)(config, "net.pth", "cpu")
    assert made.files == [tmp_path / "tools" / BASE]
    first, second = tmp_path / "one.py", tmp_path / "two.py"
    first.write_text("_base_ = ['./two.py', 'mmdet3d::three.py']")
    second.write_text("_base_ = '../four.py'")
    (tmp_path.parent / "four.py").write_text("model = dict()")
    made = mmdet3d(monkeypatch)(str(first), "net.pth", "cpu")
    named = [path.resolve() for path in made.files]
    assert named == [second, tmp_path.parent / "four.py"]


@pytest.mark.parametrize("framework", FRAMEWORKS)
def test_a_second_device_is_used_for_everything(framework, config, monkeypatch):
    current, used = ["cuda:0"], []

    @contextmanager
    def device(of):
        current.append(str(of))
        yield
        current.pop()

    def answers(points, z):
        used.append(current[-1])
        return first_point(points, z)

    def moved(own, to):
        used.append(str(to))
        return own

    kind = framework(monkeypatch, answers)
    for part in (torch.nn.Module, torch.Tensor):
        monkeypatch.setattr(part, "to", moved)
    monkeypatch.setattr(torch.cuda, "device", device)
    made = kind(config, "net.pth", "cuda:1")
    PointsOnly("theirs", made, 1.84).detect(CLOUD, NO_ANNOTATIONS)
    assert {*used} == {"cuda:1"}
    assert current == ["cuda:0"]


def test_shuffled_points_are_shuffled_alike_and_leave_the_generator_of_others(config, monkeypatch):
    made = pcdet(monkeypatch, first_point)(config, "net.pth", "cpu")
    points = np.random.default_rng(0).uniform(-9, 0, (50, 5))
    np.random.seed(7)  # noqa: NPY002 (whom others may use)
    first = np.random.random()  # noqa: NPY002
    places = [made.detect(points, 1.8).boxes.tolist()]
    np.random.seed(7)  # noqa: NPY002
    places.append(made.detect(points, 1.8).boxes.tolist())
    assert places[0] == places[1]
    assert np.random.random() == first  # noqa: NPY002


def test_two_configs_in_a_process_do_not_mix(config, monkeypatch):
    kind = pcdet(monkeypatch, first_point)
    first = kind(config, "net.pth", "cpu")
    small = Path(config).with_name("small.yaml")
    told = yaml.safe_load(Path(config).read_text()) | {
        "DATA_CONFIG": {"POINT_CLOUD_RANGE": [-5, -5, -5, 5, 5, 5]}
    }
    small.write_text(yaml.safe_dump(told))
    second = kind(str(small), "net.pth", "cpu")
    points = np.array([[10.0, 2.0, -1.0, 0.5, 0.0]])
    assert [len(each.detect(points, 1.8)) for each in (first, second)] == [1, 0]
    assert [*sys.modules["pcdet.config"].cfg] == ["ROOT_DIR"]
