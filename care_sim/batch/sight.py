"""temporary"""

import numpy as np
from care_sim.core.frames import Frame
from care_sim.core.types import ImageDetections
from care_sim.sensors.camera import (
    CameraDetector,
    Picture,
    class_table,
    faultless_detections,
    window_on,
)
from care_sim.sensors.engines import make_engine
from care_sim.world.world import WORLD_STEP_S


class Sight:
    def __init__(self, rig, conditions, worlds):
        self.rig = rig
        self.c = conditions
        self.d = {}
        self.rows = np.zeros((worlds, 128, 9))
        self.n = np.zeros(worlds, np.int64)

    def begin(self, world, built, seed):
        labels = built.labels()
        self.d[world] = (
            built,
            CameraDetector(
                [*labels], self.c, self.rig.keyframe_s, seed, self.rig.cameras, step_s=WORLD_STEP_S
            ),
            class_table(labels),
            np.array([*labels], np.int64),
            make_engine("fast", built.bullet, self.rig.grid),
        )

    def look(self, state):
        shown = np.zeros((state.worlds, state.bodies.boxes.shape[1]), bool)
        for w in np.flatnonzero(state.live).tolist():
            built, cam, classes, reported, engine = self.d[w]
            x, y, z, yaw, _, _ = state.sensors.poses[w].tolist()
            sensor = Frame(x, y, z, yaw)
            n = state.bodies.counts[w]
            built.bullet.primitives.poses = state.bodies.poses[w, :n].copy()
            boxes = sensor.boxes_to_local(state.bodies.boxes[w][reported])
            pics = []
            for c in self.rig.cameras:
                win = window_on(c, boxes)
                pics.append(Picture.of(engine.body_ids(c, sensor, win), win))
            for p in pics:
                for b in range(n):
                    shown[w, b] |= p.shows(b)
            seen = faultless_detections(pics, classes)
            cam.take(seen, sensor.yaw, boxes, float(state.times[w]))
            rows = cam.newest(sensor.yaw).detections.rows()
            self.n[w] = len(rows)
            self.rows[w, : len(rows)] = rows
        return (self.n, self.rows), shown
