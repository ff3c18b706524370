"""The commands of `care-sim` by name: where each is, and what `care-sim --help` says of it."""

import importlib
from typing import Any, NamedTuple


class CommandEntry(NamedTuple):
    """Where a command is, and what `care-sim --help` says of it."""

    module: str
    name: str
    about: str

    def loaded(self) -> Any:
        """The dataclass of its options, whose call runs it; or a table of several by name.

        Only the command that is asked for is imported: what plays, draws or learns takes seconds to
        import, for which `care-sim --help` and a mistyped name need not wait.
        """
        return getattr(importlib.import_module(f"care_sim.commands.{self.module}"), self.name)


COMMANDS = {
    "reproduce": CommandEntry(
        "reproduce",
        "Reproduce",
        "Play the paper's closed-loop study, 49 configurations per seed and those of --also, "
        "and print it beside the paper's figures.",
    ),
    "run": CommandEntry(
        "run",
        "Run",
        "Play one episode and print its timeline and outcome.",
    ),
    "compare": CommandEntry(
        "compare",
        "Compare",
        "Play the same seed under several policies and print their outcomes side by side.",
    ),
    "view": CommandEntry(
        "view",
        "View",
        "Open a recording of `run --record` or `compare --record` in the Rerun viewer (extra "
        "'viewer').",
    ),
    "benchmark": CommandEntry(
        "benchmark",
        "Benchmark",
        "Play the official suite and write a result file for every policy: one score and its "
        "parts.",
    ),
    "leaderboard": CommandEntry(
        "leaderboard",
        "Leaderboard",
        "Make one table of results of `benchmark`, or verify them by playing a random tenth of "
        "their episodes again.",
    ),
    "sweep": CommandEntry(
        "sweep",
        "Sweep",
        "Play every combination of scenarios, policies, budgets, faults and seeds.",
    ),
    "ncap": CommandEntry(
        "ncap",
        "Ncap",
        "Play the Euro NCAP tests of emergency braking: avoided, mitigated or hit, and a score.",
    ),
    "ablate": CommandEntry(
        "ablate",
        "Ablate",
        "Vary one thing at a time as the paper's ablations do, one table per thing varied; "
        "with --source in the open loop, on a quarter of the scenes.",
    ),
    "order": CommandEntry(
        "order",
        "Order",
        "Play the paper's closed-loop study under every order of the cells inside a set, 279 "
        "configurations per seed and those of --also, or with --source the first-sighting "
        "protocol, and list what the paper says order by order.",
    ),
    "firing": CommandEntry(
        "firing",
        "Firing",
        "Play the dense street under every hardware, or with --source the first-sighting protocol, "
        "and tell what a policy that knows its hardware has over one whose demand is projected.",
    ),
    "realism": CommandEntry(
        "realism",
        "Realism",
        "Play the headline tables under the conditions of a real car, with --source that of first "
        "sightings, and tell which orders of policies hold, are lost or flip.",
    ),
    "vehicle": CommandEntry(
        "vehicle",
        "Vehicle",
        "Play the paper's vehicle study: late evidence in turns, a camera that fails in mid-drive, "
        "a pose that is not exact; then time the car's software stage by stage.",
    ),
    "faults": CommandEntry(
        "faults",
        "Faults",
        "Let every fault grow and find where the order of the policies changes.",
    ),
    "crowding": CommandEntry(
        "crowding",
        "Crowding",
        "Find where the all-camera reserve collapses as vehicles fill the dense street.",
    ),
    "r157": CommandEntry(
        "r157",
        "R157",
        "Play the cut-ins that the careful human driver of UN Regulation 157 prevents, and tell "
        "which of them every policy avoids.",
    ),
    "validate": CommandEntry(
        "validate",
        "Validate",
        "Say whether a world of the closed loop discriminates: whether a camera leads the best "
        "control, a full scan leaves anything to win, and the reserves are told apart.",
    ),
    "protocol": CommandEntry(
        "protocol",
        "Protocol",
        "Play the paper's first-sighting protocol: every policy over the same keyframes, on "
        "streets or recordings.",
    ),
    "mechanism": CommandEntry(
        "mechanism",
        "Mechanism",
        "Find why policies differ: on one shared belief, and ray by ray, on streets or recordings.",
    ),
    "report": CommandEntry(
        "report",
        "PrintReport",
        "Print the tables of a folder of results and draw its figures again, or make one web "
        "page of it all.",
    ),
    "export": CommandEntry(
        "export",
        "Export",
        "Play a policy over nuScenes scenes and write its detections in the results form of the "
        "official devkit.",
    ),
    "policies": CommandEntry(
        "listings",
        "Policies",
        "List the policies with their tags, parameters and sources.",
    ),
    "detectors": CommandEntry(
        "listings",
        "Detectors",
        "List the detectors.",
    ),
    "sensors": CommandEntry(
        "listings",
        "Sensors",
        "List the sensor set-ups.",
    ),
    "scenarios": CommandEntry(
        "listings",
        "Scenarios",
        "List the scenarios and their parameters.",
    ),
    "bench": CommandEntry(
        "bench",
        "Bench",
        "Measure speed: keyframe, scans, steps and memory, beside other engines and environments.",
    ),
    "parity": CommandEntry(
        "parity",
        "Parity",
        "Compare the engine `fast` with Bullet: rays of random scenes and of every keyframe, "
        "pictures, whole episodes.",
    ),
    "certify": CommandEntry(
        "certify",
        "Certify",
        "Play a published list of episodes and say whether they go as published, or where one "
        "does not.",
    ),
    "train": CommandEntry(
        "train",
        "LEARNERS",
        "Train a learned policy on an environment: `care-sim train --help` lists the learners.",
    ),
}
