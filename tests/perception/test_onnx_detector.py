"""An ONNX file as a detector."""

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.perception.detectors import make_detector
from care_sim.perception.network_detectors import OnnxDetector
from care_sim.sensors.annotated import NO_ANNOTATIONS, NO_OBJECT, Cloud
from tests.helpers.network_files import mean_onnx

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")


@pytest.fixture
def mean_point(tmp_path):
    return mean_onnx(tmp_path / "mean.onnx")


def test_an_onnx_file_detects_with_the_fields_that_it_asks_for(mean_point):
    cloud = Cloud(
        np.array([1, 2]),
        np.array([[9.0, 1.0, -1.0], [11.0, 1.0, -1.0]]),
        np.full(2, NO_OBJECT),
        intensities=np.array([0.2, 0.4]),
    )
    detector = make_detector("onnx", 1.84, file=mean_point, fields="x,y,z,intensity")
    found, objects = detector.detect(cloud, NO_ANNOTATIONS)
    assert found.boxes[0].tolist() == pytest.approx([10.0, 1.0, -1.0, 0.6, 0.6, 1.84, 0.0])
    assert found.scores.tolist() == pytest.approx([0.3])
    assert found.velocities.tolist() == [[1.0, 2.0]]
    assert objects.tolist() == [NO_OBJECT]


def test_a_file_that_is_no_network_is_named(tmp_path):
    path = tmp_path / "none.onnx"
    with pytest.raises(InvalidInput, match="no such file; allowed is an ONNX network"):
        make_detector("onnx", 1.84, file=path)
    path.write_bytes(b"nothing")
    with pytest.raises(InvalidInput, match=r"none\.onnx: no ONNX network"):
        make_detector("onnx", 1.84, file=path)
    with pytest.raises(InvalidInput, match="unknown device 'tpu'"):
        make_detector("onnx", 1.84, file=path, device="tpu")


def test_weights_in_a_file_beside_are_known(mean_point, tmp_path):
    assert OnnxDetector(mean_point).files == ()
    network = onnx.load(mean_point)
    large = onnx.numpy_helper.from_array(np.zeros(999, np.float32), "large")
    network.graph.initializer.append(large)
    onnx.save(network, mean_point, save_as_external_data=True, location="w.data")
    assert OnnxDetector(mean_point).files == (str(tmp_path / "w.data"),)


def test_a_network_that_draws_random_numbers_is_refused(mean_point):
    network = onnx.load(mean_point)
    drawing = onnx.helper.make_node("RandomUniform", [], ["drawn"], shape=[1])
    network.graph.node.append(drawing)
    onnx.save(network, mean_point)
    with pytest.raises(InvalidInput, match=r"mean\.onnx: RandomUniform draws random numbers"):
        OnnxDetector(mean_point)
