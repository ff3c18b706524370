"""An ONNX file as a detector."""

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.types import CLASSES
from care_sim.perception.detectors import make_detector
from care_sim.sensors.annotated import NO_ANNOTATIONS, NO_OBJECT, Cloud

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")


@pytest.fixture
def mean_point(tmp_path):
    """A network that puts a pedestrian where its points have their mean; its height is that of
    the sensor, its score the mean of the last column.
    """
    helper, kind = onnx.helper, onnx.TensorProto
    numbers = {
        "zero": np.array([0], np.int64),
        "three": np.array([3], np.int64),
        "one": np.array([1], np.int64),
        "last": np.array([-1], np.int64),
        "end": np.array([99], np.int64),
        "size": np.array([[0.6, 0.6]], np.float32),
        "yaw": np.array([[0.0]], np.float32),
        "label": np.array([CLASSES.index("pedestrian")], np.int64),
        "tall": np.array([1, 1], np.int64),
        "velocity": np.array([[1.0, 2.0]], np.float32),
    }
    nodes = [
        helper.make_node("ReduceMean", ["points", "zero"], ["mean"], keepdims=1),
        helper.make_node("Slice", ["mean", "zero", "three", "one"], ["place"]),
        helper.make_node("Slice", ["mean", "last", "end", "one"], ["score"]),
        helper.make_node("Reshape", ["score", "one"], ["scores"]),
        helper.make_node("Reshape", ["sensor_height_m", "tall"], ["height"]),
        helper.make_node("Concat", ["place", "size", "height", "yaw"], ["boxes"], axis=1),
        helper.make_node("Identity", ["label"], ["classes"]),
        helper.make_node("Identity", ["velocity"], ["velocities"]),
    ]
    value = helper.make_tensor_value_info
    graph = helper.make_graph(
        nodes,
        "mean",
        [value("points", kind.FLOAT, ["P", 4]), value("sensor_height_m", kind.FLOAT, [1])],
        [
            value("classes", kind.INT64, [1]),
            value("boxes", kind.FLOAT, [1, 7]),
            value("scores", kind.FLOAT, [1]),
            value("velocities", kind.FLOAT, [1, 2]),
        ],
        [onnx.numpy_helper.from_array(array, name) for name, array in numbers.items()],
    )
    path = tmp_path / "mean.onnx"
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.save(model, path)
    return path


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
