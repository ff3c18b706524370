"""Average precision by the nuScenes devkit of what `care-sim judge --official` wrote, run in the
devkit's own environment: `make official-precision FOLDER=runs/judge`.

Class by class and as the mean over those that occur, at the devkit's four distances of centres.
All within 50 m counts; the devkit's own evaluation ends earlier for some classes and leaves out
what has no return, so these are no figures of its leaderboard.
"""

import json
import sys
from pathlib import Path

from nuscenes.eval.common.data_classes import EvalBoxes
from nuscenes.eval.common.utils import center_distance
from nuscenes.eval.detection.algo import accumulate, calc_ap
from nuscenes.eval.detection.config import config_factory
from nuscenes.eval.detection.data_classes import DetectionBox

TRUTH = "truth"


def read(path):
    return EvalBoxes.deserialize(json.loads(path.read_text()), DetectionBox)


def main(folder):
    rules = config_factory("detection_cvpr_2019")
    truth = read(folder / f"{TRUTH}.json")
    classes = sorted({box.detection_name for box in truth.all})
    if not classes:
        sys.exit(f"{folder}: nothing was there to find")
    print("detector", *classes, "mean", sep="\t")
    for path in sorted(folder.glob("*.json")):
        if path.stem == TRUTH:
            continue
        reported = read(path)
        values = []
        for name in classes:
            at = [
                calc_ap(
                    accumulate(truth, reported, name, center_distance, distance),
                    rules.min_recall,
                    rules.min_precision,
                )
                for distance in rules.dist_ths
            ]
            values.append(sum(at) / len(at))
        mean = sum(values) / len(values)
        print(path.stem, *(f"{100 * value:.1f}" for value in (*values, mean)), sep="\t")


main(Path(sys.argv[1]))
