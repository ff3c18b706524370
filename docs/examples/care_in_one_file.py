"""CARE in one file: NumPy and nothing else, to read beside the paper and to fork.

    python docs/examples/care_in_one_file.py

The sections come in the paper's order, and each heading names the equation or algorithm below it.
"Ours" marks what the paper leaves open. `Scanner` at the end joins the sections. A test of CARE-Sim
gives it the camera boxes, the detections and the odometry of the paper's 245 closed-loop episodes:
it chooses the same cells in the same order.

The LiDAR frame is x forward, y left, z up. Units are metres, seconds and radians. A box in space is
an array (x, y, z, length, width, height, yaw). A set of cells is an array of cell indices.
"""

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

Array = np.ndarray
Sets = list[Array]  # sets of cells, each in the order in which its cells are taken

# ===== Section 3, Remark 1: the angular grid of firing cells ======================================

A, E = 512, 32  # azimuth columns and elevation rows
N = A * E  # cells; the index of a cell is row * A + column
CELL_WIDTH = 2 * np.pi / A
TOP, BOTTOM = np.deg2rad([10.67, -30.67])  # nuScenes' LiDAR: rays of the first and the last row
CELL_HEIGHT = (TOP - BOTTOM) / (E - 1)


def column_at(azimuth: float) -> int:
    """Return the column of an azimuth, modulo A. Column 0 begins at -pi, behind the car."""
    return int(np.floor((azimuth + np.pi) / CELL_WIDTH))


def row_at(elevation: float) -> int:
    """Return the row whose ray is nearest to an elevation. Row 0 is the highest."""
    return int(np.floor((TOP - elevation) / CELL_HEIGHT + 0.5))


# ===== Section 3, Eq. 1: the budget ===============================================================


def budget_in_cells(beta: float) -> int:
    """Return B, the number of cells that a keyframe may fire at the budget fraction beta."""
    return round(beta * N)


# ===== Section 4.1, Algorithm 1: the shared budget allocator ======================================

RHO = 0.3  # reserve fraction (Remark 2)


def allocate(
    budget: int, rho: float, exploitation: Sets, layers: Sequence[Sets], floor: Array
) -> dict[int, str]:
    """Return the selection S: its cells in order, each with the share that paid for it."""
    chosen: dict[int, str] = {}
    fill(chosen, "exploitation", exploitation, round((1 - rho) * budget))
    for layer in layers:
        fill(chosen, "reserve", layer, budget)
    fill(chosen, "floor", [floor], budget)
    return chosen


def fill(chosen: dict[int, str], share: str, sets: Sets, limit: int) -> None:
    """Let the sets take turns until S has `limit` cells: each gives its next cell that S lacks."""
    queues = deque(iter(cells.tolist()) for cells in sets)
    while queues and len(chosen) < limit:
        queue = queues.popleft()
        for cell in queue:
            if cell not in chosen:
                chosen[cell] = share
                queues.append(queue)  # An exhausted set does not come back.
                break


# ===== Section 4.1: track forecasts, constant velocity ============================================


class Ego(NamedTuple):
    """The LiDAR's pose in the world and the car's speed, from odometry."""

    x: float
    y: float
    z: float
    yaw: float
    speed: float

    @property
    def pose(self) -> Array:
        """The pose as a box without a size."""
        return np.array([self.x, self.y, self.z, 0, 0, 0, self.yaw])

    def to_world(self, box: Array) -> Array:
        """Return a box of the LiDAR frame in the world."""
        return turned(box, self.yaw) + self.pose

    def to_lidar(self, box: Array) -> Array:
        """Return a box of the world in the LiDAR frame."""
        return turned(box - self.pose, -self.yaw)


def turned(vectors: Array, angle: float) -> Array:
    """Turn vectors (..., k) about z: x and y come first, and the other numbers stay."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    result = vectors.copy()
    result[..., 0] = cos * x - sin * y
    result[..., 1] = sin * x + cos * y
    return result


@dataclass
class Track:
    """A tracked object, where it was last detected, in the world."""

    label: str
    box: Array
    velocity: Array = field(default_factory=lambda: np.zeros(2))  # over ground; 0 while unknown
    age: int = 0  # keyframes from the last detection to the coming keyframe
    hits: int = 1  # keyframes with a detection
    streak: int = 0  # consecutive safe keyframes (Section 4.3)


class Forecast(NamedTuple):
    """A track at the coming keyframe, in the LiDAR frame."""

    track: Track
    box: Array
    velocity: Array


def forecast(track: Track, keyframe_s: float, ego: Ego) -> Forecast:
    """Move a track to the coming keyframe at constant velocity."""
    box = track.box.copy()
    box[:2] += track.velocity * (track.age * keyframe_s)
    return Forecast(track, ego.to_lidar(box), turned(track.velocity, -ego.yaw))


# ===== Section 4.1: the angular hull of a forecast, an exploitation set ===========================

AZIMUTH_MARGIN, ELEVATION_MARGIN = 2, 1  # dilation in columns and rows (Remark 2)


def hull(box: Array, azimuth_margin: int = AZIMUTH_MARGIN) -> Array:
    """Return H_i: the rectangle of cells around a forecast box, dilated, top row first."""
    centre, half, height, yaw = box[:2], box[3:5] / 2, box[5], box[6]
    corners = centre + turned(half * [[1, 1], [1, -1], [-1, -1], [-1, 1]], yaw)
    x, y = np.vstack([centre, corners]).T

    # Top and bottom look steepest at the nearest point of the footprint, flattest at the farthest.
    near = np.hypot(*np.maximum(np.abs(turned(centre, -yaw)) - half, 0))
    far = np.hypot(*corners.T).max()
    bottom, top = box[2] - height / 2, box[2] + height / 2
    elevations = np.arctan2([bottom, bottom, top, top], [near, far, near, far])
    # A box around the LiDAR covers every column.
    return dilated_rectangle(np.arctan2(y, x), elevations, A if near == 0 else azimuth_margin)


def dilated_rectangle(azimuths: Array, elevations: Array, azimuth_margin: int) -> Array:
    """Return the cells of the dilated rectangle that holds these angles, row by row.

    The first azimuth is the middle: the others lie within half a turn of it.
    """
    offsets = (azimuths - azimuths[0] + np.pi) % (2 * np.pi) - np.pi
    right = column_at(azimuths[0] + offsets.min()) - azimuth_margin
    left = column_at(azimuths[0] + offsets.max()) + azimuth_margin
    # The columns go round the car, and none counts twice.
    columns = np.unique(np.arange(right, left + 1) % A)

    upper = row_at(elevations.max()) - ELEVATION_MARGIN
    lower = row_at(elevations.min()) + ELEVATION_MARGIN
    rows = np.arange(max(upper, 0), min(lower, E - 1) + 1)
    return (rows[:, None] * A + columns).ravel()


# ===== Section 4.2: the camera model (intrinsics and extrinsics) and its detections D_t ===========


class Camera(NamedTuple):
    """A pinhole camera on the car. `axes` are its forward, left and up in the LiDAR frame."""

    focal: float
    centre: tuple[float, float]
    position: Array
    axes: Array = np.eye(3)

    def pixel(self, point: Array) -> tuple[float, float]:
        """Project a point of the LiDAR frame to (u, v), NaN for a point behind the camera."""
        depth, left, up = self.axes @ (point - self.position)
        scale = self.focal / depth if depth > 0 else np.nan
        return self.centre[0] - left * scale, self.centre[1] - up * scale

    def rays(self, u: Array, v: Array) -> Array:
        """Back-project pixels to directions (n, 3) in the LiDAR frame."""
        left, up = (self.centre[0] - u) / self.focal, (self.centre[1] - v) / self.focal
        forward, leftward, upward = self.axes
        return forward + left[:, None] * leftward + up[:, None] * upward


class CameraDetection(NamedTuple):
    """A box (left, top, right, bottom) in pixels, of the latest camera frame that has arrived."""

    label: str
    box: tuple[float, float, float, float]
    camera: Camera
    yaw_change: float = 0.0  # of the car since the camera frame (Section 5.5)


# ===== Section 4.2, Eq. 2: a detection that a forecast explains is not in the residual set ========


def is_explained(detection: CameraDetection, forecasts: Iterable[Forecast]) -> bool:
    """Return True if the centre of a same-class forecast lies in the image box."""
    left, top, right, bottom = detection.box
    for track, box, _ in forecasts:
        if track.label == detection.label:
            # Ours: the camera frame is older than the forecast. Turn the centre back to its time.
            u, v = detection.camera.pixel(turned(box[:3], detection.yaw_change))
            if left <= u <= right and top <= v <= bottom:
                return True
    return False


# ===== Section 4.2: the depth-free wedge W(d) =====================================================


def wedge(detection: CameraDetection) -> Array:
    """Return W(d): the cells behind an image box, seen from the LiDAR, dilated as a hull is."""
    left, top, right, bottom = detection.box
    u, v = (left + right) / 2, (top + bottom) / 2
    # Centre and corners; ours, for wide boxes: where the edges pass nearest to the image centre.
    near_u, near_v = np.clip(detection.camera.centre, [left, top], [right, bottom])
    rays = detection.camera.rays(
        np.array([u, left, left, right, right, near_u, near_u, left, right]),
        np.array([v, top, bottom, top, bottom, top, bottom, near_v, near_v]),
    )
    x, y, z = turned(rays, -detection.yaw_change).T
    elevations = np.arctan2(z, np.hypot(x, y))
    return dilated_rectangle(np.arctan2(y, x), elevations, AZIMUTH_MARGIN)


# ===== Section 4.2, Algorithm 2: residual reserve construction ====================================


def residual_and_explained(
    detections: Iterable[CameraDetection], forecasts: Sequence[Forecast]
) -> tuple[Sets, Sets]:
    """Return U and M: the wedges of unexplained and of explained detections.

    The forecasts are full, never shrunk by forgetting: forgetting makes no false residual.
    """
    residual, explained = [], []
    for detection in detections:
        if is_explained(detection, forecasts):
            explained.append(wedge(detection))
        else:
            residual.append(wedge(detection))
    return residual, explained


# ===== Section 4.3, Eq. 3: the guard distance =====================================================

K_SAFE, STANDSTILL_M, HEADWAY_S = 2.0, 2.0, 2.0  # k_safe, s_0, T_h (Remark 3)


def guard_distance(ego_speed: float) -> float:
    """Return d_guard: no track within it is ever forgotten."""
    return K_SAFE * (STANDSTILL_M + abs(ego_speed) * HEADWAY_S)


# ===== Section 4.3, Eq. 4: the margin for uncertain positions =====================================

POSITION_SIGMA_M = 0.0  # sigma_pos: 0 in simulation, 0.4 on the paper's vehicle (Remark 3)


def uncertainty_margin(distance: float) -> int:
    """Return m_unc: the columns that a shrunk hull keeps at this range. Ours: the cap at 2."""
    return min(int(np.ceil(POSITION_SIGMA_M / distance / CELL_WIDTH)), AZIMUTH_MARGIN)


# ===== Section 4.3, Algorithm 3: safety-bounded forgetting ========================================

RECEDING_MPS, STATIC_MPS = 1.0, 0.5  # tau_rec, tau_st (Remark 3)


def forget(forecasts: Iterable[Forecast], ego: Ego) -> Sets:
    """Return the exploitation sets, full hulls before shrunk ones. Call it once per keyframe."""
    full, shrunk = [], []
    for track, box, velocity in forecasts:
        distance = np.hypot(box[0], box[1])
        # Ours: an object recedes from the car, which drives along x, and is static over ground.
        receding = (velocity - [ego.speed, 0]) @ box[:2] > RECEDING_MPS * distance
        static = np.hypot(*velocity) < STATIC_MPS
        # A track needs two hits for a velocity.
        harmless = track.hits > 1 and (receding or static)
        low_criticality = harmless and distance > guard_distance(ego.speed)
        track.streak = track.streak + 1 if low_criticality else 0
        if low_criticality:
            # Ours: every keyframe of the streak takes one column from the margin, and never a row.
            margin = max(AZIMUTH_MARGIN - track.streak, uncertainty_margin(distance))
            shrunk.append(hull(box, margin))
        else:
            full.append(hull(box))
    return full + shrunk


# ===== Section 4, Figure 1: the 3D detections update the track memory =============================
# The paper names no tracker: ours.
GATE_M = 2.0  # a detection belongs to a forecast within this distance (Remark 1)
FIRST_SPEED_MPS = 15.0  # a track without a velocity may have moved this fast
COAST_S = 1.5  # a track without a detection is dropped after this time


def update_tracks(
    tracks: list[Track], detections: Iterable[tuple[str, Array]], keyframe_s: float, ego: Ego
) -> list[Track]:
    """Return the tracks after a scan; detections are classes and boxes in the LiDAR frame."""
    found = [Track(label, ego.to_world(box)) for label, box in detections]
    pairs = []
    for i, track in enumerate(tracks):
        elapsed = track.age * keyframe_s
        gate = GATE_M + (FIRST_SPEED_MPS * elapsed if track.hits == 1 else 0)
        for j, new in enumerate(found):
            distance = np.hypot(*(track.box[:2] + track.velocity * elapsed - new.box[:2]))
            if new.label == track.label and distance <= gate:
                pairs.append((distance, i, j))

    # The nearest pair comes first. No track and no detection is in two pairs.
    matches: dict[int, int] = {}
    for _, i, j in sorted(pairs):
        if i not in matches and j not in matches.values():
            matches[i] = j
    for i, j in matches.items():
        track, new = tracks[i], found[j]
        track.velocity = (new.box[:2] - track.box[:2]) / (track.age * keyframe_s)
        track.box, track.age, track.hits = new.box, 0, track.hits + 1

    kept = [track for track in tracks if track.age <= round(COAST_S / keyframe_s)]
    kept += [new for j, new in enumerate(found) if j not in matches.values()]
    for track in kept:
        track.age += 1
    return kept


# ===== Section 4, Figure 1: one keyframe, for CARE and the policies it is compared with ===========


@dataclass
class Scanner:
    """CARE is the policy "care". "history", "all-camera", "care-priority" and "care-sbf" differ."""

    policy: str = "care"
    beta: float = 0.1
    rho: float = RHO
    keyframe_s: float = 0.1  # in the closed loop; 0.5 on nuScenes
    tracks: list[Track] = field(default_factory=list)

    def choose(
        self, detections: Sequence[CameraDetection], ego: Ego, floor: Array
    ) -> dict[int, str]:
        """Return S_t before any return of the keyframe exists: each cell with its share.

        `floor` is a permutation of all cells, seeded by the frame and equal for all policies.
        """
        forecasts = [forecast(track, self.keyframe_s, ego) for track in self.tracks]
        forecasts.sort(key=lambda known: np.hypot(*known.box[:2]))  # nearest first
        if self.policy == "care-sbf":
            exploitation = forget(forecasts, ego)
        else:
            exploitation = [hull(known.box) for known in forecasts]

        seen = [] if self.policy == "history" else detections  # no camera
        memory = [] if self.policy == "all-camera" else forecasts  # no residual filter
        residual, explained = residual_and_explained(seen, memory)
        keeps_explained = self.policy in ("care-priority", "care-sbf")
        layers = [residual, explained] if keeps_explained else [residual]
        return allocate(budget_in_cells(self.beta), self.rho, exploitation, layers, floor)

    def remember(self, detections: Iterable[tuple[str, Array]], ego: Ego) -> None:
        """Take in what the 3D detector found among the returns of the chosen cells."""
        self.tracks = update_tracks(self.tracks, detections, self.keyframe_s, ego)


if __name__ == "__main__":
    # A parked car, tracked for two keyframes; then a camera frame with it and a new pedestrian.
    ego = Ego(0.0, 0.0, 1.84, 0.0, speed=5.0)
    car = ("car", np.array([30.0, 3.0, -1.0, 4.5, 1.9, 1.6, 0.0]))
    camera = Camera(160.0, (160.0, 90.0), np.array([0.76, 0.0, -0.33]))
    boxes = {"car": (138.0, 89.0, 150.0, 99.0), "pedestrian": (190.0, 86.0, 197.0, 104.0)}
    frame = [CameraDetection(label, box, camera) for label, box in boxes.items()]
    for policy in ("history", "care", "care-sbf"):
        scanner = Scanner(policy, beta=0.03)
        scanner.remember([car], ego)
        scanner.remember([car], ego)
        chosen = scanner.choose(frame, ego, np.random.default_rng(0).permutation(N))
        print(policy, dict(Counter(chosen.values())))
