"""MuJoCo's mj_multiRay over the same primitives, moved as mocap bodies."""

from collections.abc import Sequence

import numpy as np

from care_sim.base.extras import import_mujoco
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.world.bodies import BodyKind
from care_sim.world.bullet import NO_BODY


class MuJoCo:
    """Bodies as MuJoCo's primitives. Raises MissingExtra without MuJoCo."""

    def __init__(self, kinds: Sequence[BodyKind], grid: AngularGrid):
        self._grid = grid
        self._mujoco = mujoco = import_mujoco()

        # Bodies count from 1 in the order in which they are added, and body 0 is the world with its
        # plane: the ids of a caster. MuJoCo takes half extents; of a cylinder, radius and half
        # height.
        shapes = {
            name: getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}")
            for name in ("box", "cylinder", "sphere")
        }
        specification = mujoco.MjSpec()
        specification.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
        for kind in kinds:
            body = specification.worldbody.add_body(mocap=True)
            for part in kind.parts:
                x, y, z = (extent / 2 for extent in part.size)
                size = (x, z, 0) if part.shape == "cylinder" else (x, y, z)
                body.add_geom(type=shapes[part.shape], size=size, pos=part.centre)
        self._model = specification.compile()
        self._data = mujoco.MjData(self._model)

    def place(self, poses: Floats) -> None:
        """Move all bodies: (n, 3) x, y, heading."""
        self._data.mocap_pos[:, :2] = poses[:, :2]
        # The quaternion (w, 0, 0, z) of a turn about the vertical.
        self._data.mocap_quat[:, 0] = np.cos(poses[:, 2] / 2)
        self._data.mocap_quat[:, 3] = np.sin(poses[:, 2] / 2)
        self._mujoco.mj_kinematics(self._model, self._data)

    def cast(self, sensor: Frame, cells: Cells) -> tuple[Floats, Integers]:
        """Ranges (n,) in metres, inf without a hit, and body ids (n,), -1 there."""
        directions = sensor.vectors_to_world(self._grid.directions[cells]).ravel()
        geoms = np.empty(len(cells), np.int32)
        ranges = np.empty(len(cells))
        self._mujoco.mj_multiRay(
            self._model,
            self._data,
            sensor.origin,
            directions,
            None,  # geoms of every group
            True,  # static ones too
            -1,  # no body left out
            geoms,
            ranges,
            None,  # no normals
            len(cells),
            self._grid.range_m,
        )
        met = (geoms >= 0) & (ranges <= self._grid.range_m)
        return np.where(met, ranges, np.inf), np.where(met, self._model.geom_bodyid[geoms], NO_BODY)
