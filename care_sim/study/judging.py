"""Detectors on the scans of a scene: their detections and times."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.types import Detections
from care_sim.envs.sensing import detector_of
from care_sim.evaluation.detector_quality import SceneBoxes, scene_boxes
from care_sim.evaluation.sightings import RANGE_M
from care_sim.loops.film import Film
from care_sim.loops.gathering import gather_sweeps
from care_sim.sensors.annotated import Annotations, Cloud
from care_sim.sources.nuscenes.detections import result_boxes
from care_sim.sources.nuscenes.table_files import JsonRow
from care_sim.study.play_config import PlayConfig
from care_sim.study.scene_play import play_through_film

TIMED_SCANS = 8
"""Timed full scans of a scene per detector, after as many untimed ones."""


Samples = dict[str, list[JsonRow]]
"""Boxes by keyframe in the official form (`care_sim.sources.nuscenes.detections`)."""


@dataclass(frozen=True)
class JudgedScene:
    """One detector in one scene: its `boxes`, the CPU time of full scans, `scan_ms` (t,), and the
    boxes in range in the official form, `reported` and `true`.
    """

    boxes: SceneBoxes
    scan_ms: Floats
    reported: Samples
    true: Samples


def judge_scene(configs: Sequence[PlayConfig]) -> list[JudgedScene]:
    """Return the detections of these plays, all of one scene.

    Raises InvalidInput where the film of the scene cannot be made.
    """
    film, source = configs[0].film(), configs[0].source
    there = [_as_detections(shot.annotations) for shot in film.shots]
    true = _in_range(film, there, [np.zeros((len(one), 2)) for one in there])
    judged = []
    for config in configs:
        # Detectors may want different numbers of sweeps.
        if config.source != source:
            film, source = config.film(), config.source
        record = play_through_film(config, film)
        # The unsure ones count too: precision is a curve over scores.
        reports = [keyframe.reported for keyframe in record.keyframes]
        velocities = [keyframe.velocities for keyframe in record.keyframes]
        judged.append(
            JudgedScene(
                scene_boxes(record.score.sightings, reports),
                _scan_ms(config, film),
                _in_range(film, reports, velocities),
                true,
            )
        )
    return judged


def _in_range(film: Film, reports: Sequence[Detections], velocities: Sequence[Floats]) -> Samples:
    """Return, by keyframe, the boxes that are scored. True speeds are unknown and set to 0."""
    made = {}
    for shot, report, speeds in zip(film.shots, reports, velocities, strict=True):
        near = planar_ranges(report.boxes) <= RANGE_M
        made[shot.token] = result_boxes(shot, report.take(near), speeds[near])
    return made


def _as_detections(annotations: Annotations) -> Detections:
    many = np.ones(len(annotations))
    return Detections(annotations.classes, annotations.boxes, many.astype(np.int64), many)


def _scan_ms(config: PlayConfig, film: Film) -> Floats:
    with config.make_env(film) as env:
        detector = detector_of(
            config.detector, dict(config.detector_parameters), env.conditions, env.rig
        ).begin(np.random.SeedSequence(0), env.rig, is_filmed=True)
    # The first scans find caches cold that a drive would keep warm.
    times = []
    for shot in film.shots[: 2 * TIMED_SCANS]:
        cloud = gather_sweeps(shot.cloud.to_shots(), Cloud.to_shots, shot)
        detector.at(shot.token, shot.sensor)
        started = time.thread_time()
        detector.detect(cloud, shot.annotations)
        times.append(1e3 * (time.thread_time() - started))
    return np.array(times[len(times) // 2 :])
