"""Small networks in files."""

import numpy as np

from care_sim.core.types import CLASSES


def middle_script(path):
    """A module that sees one person amid the points, or none where there are no points; in training
    it is unsure.
    """
    import torch

    class Middle(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.sure = torch.nn.Parameter(torch.tensor([0.75]))

        def forward(self, points: torch.Tensor, sensor_height_m: float):
            assert points.dtype == torch.float32
            if points.shape[0] == 0:
                return torch.zeros(0, dtype=torch.int64), torch.zeros(0, 7), torch.zeros(0)
            x, y = points[:, 0].mean(), points[:, 1].mean()
            rest = torch.tensor([0.9 - sensor_height_m, 4.0, 4.0, 4.0, 0.0])
            boxes = torch.cat([torch.stack([x, y]), rest]).unsqueeze(0)
            scores = torch.zeros(1) if self.training else self.sure.expand(1)
            return torch.tensor([4]), boxes, scores

    torch.jit.script(Middle()).save(str(path))
    return path


def mean_onnx(path):
    """A network that puts a pedestrian where its points have their mean; its height is that of
    the sensor, its score the mean of the last column, a fourth.
    """
    import onnx

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
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.save(model, path)
    return path


def counting_script(path):
    """A module that remembers how often it was called, which moves its one person."""
    import torch

    class Counting(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.register_buffer("calls", torch.zeros(1))

        def forward(self, points: torch.Tensor, sensor_height_m: float):
            self.calls += 1
            box = torch.tensor([[5.0, 0.0, -1.0, 4.0, 4.0, 4.0, 0.0]])
            box[0, 0] += self.calls[0]
            return torch.tensor([4]), box, torch.ones(1)

    torch.jit.script(Counting()).save(str(path))
    return path


def drawing_script(path, forked):
    """A module that puts its person at a random place, drawn in a task of its own or not."""
    import torch

    class Drawing(torch.nn.Module):
        def __init__(self, forked: bool):
            super().__init__()
            self.forked = forked

        def forward(self, points: torch.Tensor, sensor_height_m: float):
            x = torch.zeros(1)
            if self.forked:
                x += torch.jit.wait(torch.jit.fork(torch.rand, 1))
            elif points.shape[0] > 0:
                x += torch.rand(1)
            rest = torch.tensor([0.0, -1.0, 4.0, 4.0, 4.0, 0.0])
            return torch.tensor([4]), torch.cat([x, rest]).unsqueeze(0), torch.ones(1)

    torch.jit.script(Drawing(forked)).save(str(path))
    return path


def interface_script(path):
    """A module that chooses one of its layers by number, which PyTorch cannot freeze."""
    import torch

    @torch.jit.interface
    class Layer(torch.nn.Module):
        def forward(self, x: torch.Tensor) -> torch.Tensor:
            pass

    class Same(torch.nn.Module):
        def forward(self, x: torch.Tensor) -> torch.Tensor:
            return x

    class Chosen(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.layers = torch.nn.ModuleList([Same(), Same()])

        def forward(self, points: torch.Tensor, sensor_height_m: float):
            layer: Layer = self.layers[int(sensor_height_m)]
            box = torch.cat([layer.forward(points)[0, :3], torch.ones(4)]).unsqueeze(0)
            return torch.tensor([4]), box, torch.ones(1)

    torch.jit.script(Chosen()).save(str(path))
    return path
