"""`care-sim vehicle`: the paper's vehicle study on simulated drives, and the time that the car's
software takes.
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from care_sim.base.bounds import bounded
from care_sim.base.files import JSON, check_output, write_text
from care_sim.commands.shared.episode_studies import FixedStudy
from care_sim.commands.shared.study_command import DONE, console
from care_sim.measure.compute_path.report import compute_report, compute_tables
from care_sim.study.designs.vehicle import vehicle_study
from care_sim.study.run_config import RunConfig

_FILE = "compute-path.json"


@dataclass(frozen=True, kw_only=True)
class Vehicle(FixedStudy):
    """Play late evidence, a failing camera, a wrong pose; time it.

    Play the paper's vehicle study: late evidence in turns, a camera that fails in mid-drive, a
    pose that is not exact; then time the car's software stage by stage.
    """

    also: tuple[str, ...] | None = ()
    """Further policies, installed ones too, that are played beside those of the study; not
    care-sbf, full or all-camera, of which it asks some questions itself."""
    frames: int = bounded(1000, 0, 100_000)
    """Keyframes over which the software is timed, on one core; 0 leaves it out."""

    def __call__(self) -> int:
        """Run it."""
        return self.play("vehicle", vehicle_study, "vehicle")

    def play_study(
        self, study: str, configs: Sequence[RunConfig], name: str, left_out: Sequence[str] = ()
    ) -> int:
        """Play the episodes, once it is sure that the timings after them can be written."""
        out = self.folder(study, configs, name)
        if self.frames:
            check_output(out / _FILE, JSON)
        code = super(Vehicle, replace(self, out=out)).play_study(study, configs, name, left_out)
        if self.frames and code == DONE:
            report = compute_report(self.frames, partial(print, "measuring", file=sys.stderr))
            for table in compute_tables(report):
                console().print(table.rich())
            write_text(out / _FILE, json.dumps(report, indent=1) + "\n")
        return code
