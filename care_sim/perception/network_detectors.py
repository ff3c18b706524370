"""Detectors that run a network: conventions of inputs and outputs, and detectors for TorchScript
and ONNX files.
"""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from io import BytesIO
from os import PathLike, fspath
from pathlib import Path
from threading import Lock
from typing import Any, ClassVar

import numpy as np

from care_sim.base.checks import check_known, check_number
from care_sim.base.errors import InvalidInput, error_line
from care_sim.base.extras import import_extra, import_torch
from care_sim.core.arrays import Floats, Integers
from care_sim.core.types import CLASSES, Detections
from care_sim.perception.points_only import FIELDS, inside

FORWARD, RIGHT = AXES = "forward", "right"
"""Direction of a network's x axis: forward, as ours and KITTI's, or right, as in nuScenes' raw
sweeps; y is left of it.
"""
Names = str | Sequence[str]
_DRAWING = Lock()
"""Held while a network draws random numbers: all threads share the generator of PyTorch."""
_ONNX_DRAWS = rb"(?:RandomNormal|RandomUniform|Multinomial|Bernoulli)"
# The wire format of ONNX: field 4 of a node, its type, and an entry "location" of external data.
# In both a length of one byte comes before the name.
_ONNX_TYPE = re.compile(rb'"[\x09-\x11](' + _ONNX_DRAWS + rb"(?:Like)?)")
_ONNX_LOCATION = re.compile(rb"\x0a\x08location\x12([\x01-\x7f])")


class NetworkDetector:
    """Base of a detector around a network, with the network's conventions
    (`docs/write/your-detector.md`).

    - `fields`: the columns that it was trained with, of `care_sim.perception.points_only.FIELDS`.
    - `axes`: `forward` or `right` (`AXES`).
    - `full_intensity`: the intensity that a full return had in training: 255 for nuScenes.
    - `classes`: the names of its labels in order; those outside the five classes are left out.

    Names may come as one text with commas. Raises InvalidInput for values that are not allowed.
    """

    def __init__(
        self,
        fields: Names = FIELDS[:3],
        axes: str = FORWARD,
        full_intensity: float = 1.0,
        classes: Names = CLASSES,
    ):
        check_known("axes", axes, AXES)
        check_number("full_intensity", full_intensity, 0)
        self.fields = _listed(fields)
        if self.fields[:3] != FIELDS[:3]:
            raise InvalidInput(f"fields must begin with x,y,z, got {','.join(self.fields)}")
        for field in self.fields:
            check_known("field", field, FIELDS)
        self._axes = axes
        self._full_intensity = full_intensity
        names = _listed(classes)
        if not {*names} & {*CLASSES}:
            raise InvalidInput(
                f"classes must name one of {', '.join(CLASSES)} at least, got {', '.join(names)}"
            )
        self._labels = np.array([CLASSES.index(n) if n in CLASSES else -1 for n in names])

    def points_for(self, points: Floats) -> np.ndarray:
        """Return (P, k) float32 points in the network's conventions."""
        given = np.array(points, np.float32)
        if self._axes == RIGHT:
            given[:, 0], given[:, 1] = -points[:, 1], points[:, 0]
        if "intensity" in self.fields:
            given[:, self.fields.index("intensity")] *= self._full_intensity
        return given

    def detections(
        self,
        points: Floats,
        labels: Integers,
        boxes: Floats,
        scores: Floats,
        velocities: Floats | None = None,
    ) -> Detections:
        """Return the network's output for `points` (P, k) as detections. `labels` (n,) index its
        classes. `boxes` (n, 7) are centre, length, width, height and yaw in its axes. `scores` are
        (n,), `velocities` (n, 2) or None.

        Raises InvalidInput for a label that no class has.
        """
        labels = np.asarray(labels, np.int64)
        if labels.size and not 0 <= labels.min() <= labels.max() < len(self._labels):
            raise InvalidInput(
                f"the network answers the labels {labels.min()} to {labels.max()}, and its classes "
                f"have 0 to {len(self._labels) - 1}; name them all in classes"
            )
        kept = self._labels[labels] >= 0
        # Wrong shapes are reported where all outputs are checked; empty outputs may have any shape.
        own = np.asarray(boxes, float)[kept] if labels.size else np.empty((0, 7))
        moves = None if velocities is None else np.asarray(velocities, float)[kept]
        if self._axes == RIGHT and labels.size:
            own = np.column_stack([own[:, 1], -own[:, 0], own[:, 2:6], own[:, 6] - np.pi / 2])
            moves = None if moves is None else np.column_stack([moves[:, 1], -moves[:, 0]])
        held = inside(points[:, :3], own).sum(axis=1)
        return Detections(self._labels[labels][kept], own, held, np.asarray(scores)[kept], moves)


class NetworkFile(NetworkDetector):
    """A network in a `file` that runs on a `device`. Raises InvalidInput for a file that is missing
    or holds no such network, MissingExtra without its library.
    """

    allowed: ClassVar[str]
    """Name of this kind of file in messages."""

    def __init__(
        self,
        file: str | PathLike[str],
        device: str = "cpu",
        fields: Names = FIELDS[:3],
        axes: str = FORWARD,
        full_intensity: float = 1.0,
        classes: Names = CLASSES,
    ):
        super().__init__(fields, axes, full_intensity, classes)
        self._open(fspath(file), device)

    def _open(self, file: str, device: str) -> None:
        raise NotImplementedError

    def _check_file(self, file: str) -> None:
        if not Path(file).is_file():
            raise InvalidInput(f"{file}: no such file; allowed is {self.allowed}")


class TorchScriptDetector(NetworkFile):
    """Runs a TorchScript module: `forward(points, sensor_height_m) -> (classes, boxes, scores)`.

    Inputs: `points`, a float32 tensor (P, k) with the `fields`, and `sensor_height_m`, a float. The
    outputs `classes` (n,), `boxes` (n, 7), `scores` (n,) and optionally `velocities` (n, 2) are
    those of `NetworkDetector.detections`. `device`: cpu, cuda, cuda:1. Stateless if `forward`
    provably never writes to the module. A module that draws random numbers draws the same ones in
    every call. Needs torch.
    """

    allowed = "a TorchScript module (torch.jit.save)"

    def _open(self, file: str, device: str) -> None:
        torch = import_torch()
        self._device = device
        self._check_file(file)
        try:
            torch.empty(0, device=device)
        # A PyTorch without CUDA asserts.
        except (RuntimeError, AssertionError) as error:
            raise InvalidInput(f"device {device} is not here ({error_line(error)})") from error
        try:
            self._module = torch.jit.load(file, map_location=device).eval()
        except RuntimeError as error:
            raise InvalidInput(
                f"{file}: no TorchScript module; allowed is {self.allowed}"
            ) from error
        if not hasattr(self._module, "forward"):
            raise InvalidInput(f"{file}: the module has no method forward(points, sensor_height_m)")
        try:
            # In a frozen copy all is constant that no method writes.
            graph = torch.jit.freeze(self._module, optimize_numerics=False).graph
        except RuntimeError:
            # Some working modules cannot be frozen, so they are not known to be stateless.
            self.stateless, self._draws = False, True
            return
        nodes = [*_nodes(graph)]
        kinds = {node.kind() for node in nodes}
        # The nodes do not include those of a fork.
        self.stateless = kinds.isdisjoint(("prim::GetAttr", "prim::fork"))
        self._draws = "prim::fork" in kinds or any(node.isNondeterministic() for node in nodes)

    def detect(self, points: Floats, sensor_height_m: float) -> Detections:
        """See `care_sim.perception.points_only.PointDetector`."""
        torch = import_torch()
        draws = _same_draws(torch, self._device) if self._draws else nullcontext()
        with torch.inference_mode(), draws:
            given = torch.from_numpy(self.points_for(points)).to(self._device)
            outputs = self._module(given, float(sensor_height_m))
        # A view of a parameter keeps its gradient even here.
        return self.detections(points, *(output.detach().cpu().numpy() for output in outputs))

    def __getstate__(self) -> dict[str, Any]:
        # A module that writes to itself is read again from the file in its initial state.
        written = BytesIO()
        import_torch().jit.save(self._module, written)
        return vars(self) | {"_module": written.getvalue()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        written = BytesIO(state["_module"])
        self._module = import_torch().jit.load(written, map_location=self._device)


def _nodes(block: Any) -> Iterator[Any]:
    """The nodes of a TorchScript graph, those of its branches and loops too."""
    for node in block.nodes():
        yield node
        for inner in node.blocks():
            yield from _nodes(inner)


@contextmanager
def _same_draws(torch: Any, device: str) -> Iterator[None]:
    """Restart PyTorch's random numbers within the block, and restore their state afterwards."""
    with _DRAWING, torch.random.fork_rng([device] if device.startswith("cuda") else []):
        torch.manual_seed(0)
        yield


class OnnxDetector(NetworkFile):
    """Runs an ONNX file. Inputs: `points` (P, k) float32 and optionally `sensor_height_m` (1,)
    float32. Outputs, in order: classes, boxes, scores, and optionally velocities, as of
    `TorchScriptDetector`.

    `device`: cpu or cuda, for which ONNX Runtime needs its own package. A network that draws random
    numbers raises InvalidInput: they depend on all earlier calls. Needs onnxruntime.
    """

    allowed = "an ONNX network"
    stateless = True

    def _open(self, file: str, device: str) -> None:
        check_known("device", device, ("cpu", "cuda"))
        runtime = import_extra("onnxruntime", "ONNX Runtime", "onnx")
        self._check_file(file)
        options = runtime.SessionOptions()
        # Workers share the cores already.
        options.intra_op_num_threads = 1
        provider = "CUDAExecutionProvider" if device == "cuda" else "CPUExecutionProvider"
        if provider not in runtime.get_available_providers():
            raise InvalidInput(f"onnxruntime has no {provider} here: install onnxruntime-gpu")
        try:
            self._session = runtime.InferenceSession(file, options, providers=[provider])
        except Exception as error:
            told = " ".join(str(error).split())[:200]
            raise InvalidInput(f"{file}: no ONNX network ({told})") from error
        content = Path(file).read_bytes()
        if drawing := _ONNX_TYPE.search(content):
            raise InvalidInput(
                f"{file}: {drawing[1].decode()} draws random numbers; export the network without"
            )
        self.files = tuple(_external_data(Path(file), content))
        self._inputs = [each.name for each in self._session.get_inputs()]
        if "points" not in self._inputs or {*self._inputs} - {"points", "sensor_height_m"}:
            raise InvalidInput(
                f"{file}: its inputs must be points and perhaps sensor_height_m, they are "
                f"{', '.join(self._inputs)}"
            )

    def detect(self, points: Floats, sensor_height_m: float) -> Detections:
        """See `care_sim.perception.points_only.PointDetector`."""
        known = {
            "points": self.points_for(points),
            "sensor_height_m": np.array([sensor_height_m], np.float32),
        }
        outputs = self._session.run(None, {name: known[name] for name in self._inputs})
        return self.detections(points, *outputs)


def _external_data(file: Path, content: bytes) -> Iterator[str]:
    """The files beside an ONNX file that hold its larger weights."""
    ends = ((found.end(), found[1][0]) for found in _ONNX_LOCATION.finditer(content))
    for name in {content[end : end + length] for end, length in ends}:
        yield str(file.absolute().parent / name.decode())


def has_point_in(limits: Sequence[float], points: np.ndarray) -> bool:
    """Return True if one of `points` (P, k) lies within `limits` (least x, y, z, then greatest). A
    network of voxels fails without one.
    """
    low, high = np.split(np.asarray(limits, float), 2)
    return bool(np.all((points[:, :3] >= low) & (points[:, :3] < high), axis=1).any())


def _listed(names: Names) -> tuple[str, ...]:
    return tuple(names.split(",")) if isinstance(names, str) else tuple(names)
