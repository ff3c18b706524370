"""Detectors by name: ours, those of installed packages, and one from a TorchScript file that the
test writes.
"""

from dataclasses import replace

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.perception.detectors import DETECTORS, detector_names, make_detector
from care_sim.perception.points_only import BrokenDetector, PointsOnly
from care_sim.sensors.annotated import Annotations, Cloud
from tests.helpers.made_points import HEIGHT, shell
from tests.helpers.network_files import middle_script

POINTS = shell(8, 6, 0.4, 4.61, 1.95, 1.72)
CLOUD = Cloud(np.arange(len(POINTS)), POINTS, np.full(len(POINTS), 3))
CAR = Annotations(np.array([3]), np.array([0]), np.array([[8, 6, -1, 4.61, 1.95, 1.72, 0.4]]))

MODULE = '''
import numpy as np
from care_sim.core.types import Detections

module = 3


class Middle:
    """One person amid the points."""

    def __init__(self, label=4):
        self.label = label

    def detect(self, points, sensor_height_m):
        box = [*points.mean(axis=0)[:2], 0.9 - sensor_height_m, 0.7, 0.7, 1.8, 0.0]
        return Detections(np.array([self.label]), np.array([box]), np.array([len(points)]))


class Stubborn(Middle):
    def __init__(self):
        raise RuntimeError("no weights")


def listed(*places):
    return Middle(len(places))


def loose(**things):
    return Middle(things["label"])


def quits():
    raise SystemExit(2)


class Blind:
    """Detects nothing, by nothing."""
'''


@pytest.fixture
def installed(install):
    things = {
        "middle": "Middle",
        "stubborn": "Stubborn",
        "blind": "Blind",
        "number": "module",
        "lost": "Nowhere",
    }
    things |= {"listed": "listed", "loose": "loose", "quits": "quits"}
    install(
        "own_detectors", MODULE, DETECTORS.group, returns="Middle", torchscript="Middle", **things
    )


def test_an_installed_detector_is_listed_made_and_handed_points_only(installed):
    assert detector_names()[10:] == [
        "blind",
        "listed",
        "loose",
        "lost",
        "middle",
        "number",
        "quits",
        "stubborn",
    ]
    detector = make_detector("middle", HEIGHT, label=0)
    assert isinstance(detector, PointsOnly)
    found, _ = detector.detect(CLOUD, CAR)
    assert found.boxes[0, :2] == pytest.approx(POINTS.mean(axis=0)[:2])
    assert found.classes.tolist() == [0]


def test_a_maker_that_takes_parameters_by_any_name_is_handed_them(installed):
    assert make_detector("loose", HEIGHT, label=2).detect(CLOUD, CAR)[0].classes.tolist() == [2]


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("stubborn", r"detector stubborn refuses \{\}: RuntimeError: no weights"),
        ("quits", r"detector quits refuses \{\}: SystemExit: 2"),
        ("blind", "detector blind is no PointDetector: Blind has no method detect"),
        ("number", "detector number cannot be loaded: own_detectors:module is not callable"),
        ("lost", "detector lost cannot be loaded: AttributeError: .*Nowhere"),
    ],
)
def test_a_broken_one_gets_one_line(installed, name, line):
    with pytest.raises(BrokenDetector, match=f"^{line}") as error:
        make_detector(name, HEIGHT)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "parameters", "line"),
    [
        (
            "yolo",
            {},
            "unknown detector 'yolo'; known: centerpoint, cluster, graded, megvii, onnx, pillars, "
            "pointrcnn, recorded, returns, torchscript; "
            "`care-sim list detectors` tells what each is",
        ),
        (
            "returns",
            {"least": 3},
            "unknown parameter of detector returns 'least'; known: min_returns",
        ),
        ("returns", {"min_returns": 0}, "min_returns must be a whole number >= 1, got 0"),
        (
            "cluster",
            {"eps": 1},
            "unknown parameter of detector cluster 'eps'; the nearest is sweeps; "
            "known: grid, sweeps, track_score",
        ),
        ("torchscript", {}, "detector torchscript needs the parameter file"),
    ],
)
def test_names_and_parameters_are_checked(name, parameters, line):
    with pytest.raises(InvalidInput, match=f"^{line}$"):
        make_detector(name, HEIGHT, **parameters)


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_a_torchscript_file_detects(tmp_path):
    pytest.importorskip("torch")
    detector = make_detector("torchscript", HEIGHT, file=middle_script(tmp_path / "middle.pt"))
    found, objects = detector.detect(CLOUD, CAR)
    assert (found.classes.tolist(), found.scores.tolist(), objects.tolist()) == ([4], [0.75], [3])
    assert found.boxes[0, :3] == pytest.approx([*POINTS.mean(axis=0)[:2], 0.9 - HEIGHT], abs=1e-5)
    near = np.abs(POINTS - found.boxes[0, :3]) <= 2.0
    assert found.returns.tolist() == [np.count_nonzero(near.all(axis=1))]
    assert len(detector.detect(CLOUD.take(np.zeros(len(CLOUD), bool)), CAR)[0]) == 0


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_a_torchscript_file_is_given_the_fields_that_it_asks_for(tmp_path):
    """It reports the lag of the first point as its score, and velocities."""
    torch = pytest.importorskip("torch")

    class Clock(torch.nn.Module):
        def forward(self, points: torch.Tensor, sensor_height_m: float):
            boxes = torch.cat([points[:1, :3], torch.ones(1, 4)], dim=1)
            return torch.tensor([4]), boxes, points[:1, 3], torch.ones(1, 2)

    torch.jit.script(Clock()).save(str(tmp_path / "clock.pt"))
    asked = {"file": tmp_path / "clock.pt", "fields": "x,y,z,time_lag"}
    detector = make_detector("torchscript", HEIGHT, **asked)
    earlier = replace(CLOUD, times=np.full(len(CLOUD), -0.25))
    assert [detector.detect(cloud, CAR)[0].scores.tolist() for cloud in (CLOUD, earlier)] == [
        [0.0],
        [0.25],
    ]
    assert detector.detect(CLOUD, CAR)[0].velocities.tolist() == [[1.0, 1.0]]
    with pytest.raises(InvalidInput, match="unknown field 'time'"):
        make_detector("torchscript", HEIGHT, **asked | {"fields": "x,y,z,time"})
