"""Small drives in the layout of KITTI's tracking benchmark, written from a world that is known."""

import numpy as np
from scipy.spatial.transform import Rotation

AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""From a camera's axes to those of the car."""
FRAMES = 21
STANDING = {
    0: ("Van", (2.0, 1.8, 4.5), (18.0, 4.0), 0.3),
    1: ("Car", (1.5, 1.7, 4.0), (28.0, -5.0), -2.0),
    2: ("Pedestrian", (1.8, 0.7, 0.8), (24.0, 1.0), 1.0),
    3: ("Misc", (1.0, 1.0, 1.0), (30.0, 6.0), 0.0),
    4: ("Cyclist", (1.7, 0.6, 1.8), (33.0, 0.0), 0.5),
}
"""Type, height, width and length, place in the world and yaw of what stands, by number."""
CAMERA_HEIGHT_M = 1.65
CALIBRATION = {
    "P2": "721.5377 0 609.5593 44.85728 0 721.5377 172.854 0.2163791 0 0 1 0.002745884",
    "R_rect": "0.9999239 0.00983776 -0.007445048 -0.009869795 0.9999421 -0.004278459 0.007402527 "
    "0.004351614 0.9999631",
    "Tr_velo_cam": "0.007533745 -0.9999714 -0.000616602 -0.004069766 0.01480249 0.0007280733 "
    "-0.9998902 -0.07631618 0.9998621 0.00752379 0.01480755 -0.2717806",
    "Tr_imu_velo": "0.9999976 0.0007553071 -0.002035826 -0.8086759 -0.0007854027 0.9998898 "
    "-0.01482298 0.3195559 0.002024406 0.01482454 0.9998881 -0.7997231",
}


def cameras():
    """Per frame the camera's turn (3, 3) and place (3,) in the world: a bend uphill."""
    yaws = 0.01 * np.arange(FRAMES)
    steps = 0.8 * np.stack([np.cos(yaws), np.sin(yaws)], axis=1)
    places = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)[:-1]])
    for frame, (yaw, (x, y)) in enumerate(zip(yaws, places, strict=True)):
        turn = Rotation.from_euler("ZYX", [yaw, -0.02 * np.sin(frame), 0.01]).as_matrix() @ AXES
        yield turn, np.array([x, y, CAMERA_HEIGHT_M + 0.02 * frame])


def labels():
    """The lines of the label file; one object comes with frame 8."""
    for frame, (turn, place) in enumerate(cameras()):
        yield f"{frame} -1 DontCare -1 -1 -10 219 188 245 218 -1000 -1000 -1000 -10 -1 -1 -1"
        for number, (kind, size, (x, y), yaw) in STANDING.items():
            if number == 2 and frame < 8:
                continue
            middle = turn.T @ ([x, y, size[0] / 2] - place)
            ahead = turn.T @ [np.cos(yaw), np.sin(yaw), 0.0]
            rotation = np.arctan2(-ahead[2], ahead[0])
            numbers = [*size, middle[0], middle[1] + size[0] / 2, middle[2], rotation]
            told = " ".join(f"{value:.9f}" for value in numbers)
            yield f"{frame} {number} {kind} 0 0 0 0 0 100 100 {told}"


def _rigid(name):
    numbers = np.array(CALIBRATION[name].split(), dtype=float).reshape(3, -1)
    whole = np.eye(4)
    whole[:3, : numbers.shape[1]] = numbers
    return whole


def write(folder, drive="0000", oxts=False):
    """Write labels, calibration, and poses: of the camera, or of the inertial unit."""
    for part in ("label_02", "calib", "oxts"):
        (folder / "training" / part).mkdir(parents=True, exist_ok=True)
    (folder / "training" / "label_02" / f"{drive}.txt").write_text("\n".join(labels()) + "\n")
    calibration = [f"{name}: {numbers} " for name, numbers in CALIBRATION.items()]
    (folder / "training" / "calib" / f"{drive}.txt").write_text("\n".join(calibration) + "\n\n")
    if oxts:
        (folder / "training" / "oxts" / f"{drive}.txt").write_text("\n".join(_oxts()) + "\n")
        return
    (folder / "poses").mkdir(exist_ok=True)
    first_turn, first_place = next(cameras())
    rows = [
        np.column_stack([first_turn.T @ turn, first_turn.T @ (place - first_place)]).ravel()
        for turn, place in cameras()
    ]
    np.savetxt(folder / "poses" / f"{drive}.txt", rows, fmt="%.9f")


def _oxts():
    parts = (_rigid(name) for name in ("R_rect", "Tr_velo_cam", "Tr_imu_velo"))
    camera_from_imu = np.linalg.multi_dot([*parts])
    latitude, longitude, radius = np.radians(49.0), np.radians(8.4), 6_378_137.0
    scale = np.cos(latitude)
    start = np.log(np.tan(np.pi / 4 + latitude / 2))
    for turn, place in cameras():
        camera = np.eye(4)
        camera[:3, :3], camera[:3, 3] = turn, place
        imu = camera @ camera_from_imu
        x, y, z = imu[:3, 3]
        # Mercator's projection, inverted: the world's origin lies at this place on the Earth.
        north = 2 * np.arctan(np.exp(start + y / (scale * radius))) - np.pi / 2
        roll, pitch, yaw = Rotation.from_matrix(imu[:3, :3]).as_euler("xyz")
        told = [np.degrees(north), np.degrees(longitude + x / (scale * radius)), 110.0 + z]
        yield " ".join(f"{value:.12f}" for value in [*told, roll, pitch, yaw, *[0.0] * 24])
