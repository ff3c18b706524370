"""The commands of `care-sim` by name: where their options and what they do are, and the line that
help shows. Only the command that is asked for is imported.
"""

import importlib
from typing import Any, NamedTuple


class Command(NamedTuple):
    """A command: the class of its options, the function that takes them, and what it is for.

    Both are MODULE:NAME in `care_sim`. Without a function the options are called.
    """

    options: str
    run: str
    about: str

    def options_class(self) -> Any:
        """The class of its options."""
        return _loaded(self.options)

    def function(self) -> Any:
        """What runs the options and returns an exit code."""
        return _loaded(self.run) if self.run else lambda options: options()


def _loaded(place: str) -> Any:
    module, name = place.split(":")
    return getattr(importlib.import_module(f"care_sim.{module}"), name)


_OPTIONS = "commands.options"
_WATCHING, _RESULTS = f"{_OPTIONS}.watching", f"{_OPTIONS}.results"
_STUDIES, _FURTHER = f"{_OPTIONS}.studies", f"{_OPTIONS}.further_studies"
_WEIGHTS = "training.weights_config"

GROUPS: dict[str, dict[str, Command]] = {
    "Play and watch": {
        "run": Command(
            f"{_WATCHING}:Run", "commands.run:run", "Play one episode; also a trained agent."
        ),
        "compare": Command(
            f"{_WATCHING}:Compare",
            "commands.compare:compare",
            "Play one seed under several policies.",
        ),
        "view": Command(
            f"{_WATCHING}:View", "commands.view:view", "Open a recording in the Rerun viewer."
        ),
    },
    "Studies": {
        "reproduce": Command(
            f"{_STUDIES}:Reproduce",
            "commands.studies.closed_loop:reproduce",
            "Play the paper's study beside the paper's figures.",
        ),
        "sweep": Command(
            f"{_STUDIES}:Sweep",
            "commands.studies.closed_loop:sweep",
            "Play every combination of scenarios, policies, budgets, faults.",
        ),
        "protocol": Command(
            f"{_STUDIES}:Protocol",
            "commands.studies.open_loop:protocol",
            "Play the first-sighting protocol, on streets or recordings.",
        ),
        "study ablate": Command(
            f"{_FURTHER}:Ablate",
            "commands.studies.either_loop:ablate",
            "Vary one thing at a time, as the paper's ablations do.",
        ),
        "study order": Command(
            f"{_FURTHER}:Order",
            "commands.studies.either_loop:order",
            "Play the paper's study under every order of cells in a set.",
        ),
        "study faults": Command(
            f"{_FURTHER}:Faults",
            "commands.studies.closed_loop:faults",
            "Let every fault grow until the order of the policies changes.",
        ),
        "study crowding": Command(
            f"{_FURTHER}:Crowding",
            "commands.studies.closed_loop:crowding",
            "Fill the dense street until the all-camera reserve collapses.",
        ),
        "study ncap": Command(
            f"{_FURTHER}:Ncap",
            "commands.studies.closed_loop:ncap",
            "Play the Euro NCAP tests: avoided, mitigated or hit; a score.",
        ),
        "study r157": Command(
            f"{_FURTHER}:R157",
            "commands.studies.closed_loop:r157",
            "Play the preventable cut-ins of UN Regulation 157.",
        ),
        "study validate": Command(
            f"{_FURTHER}:Validate",
            "commands.studies.closed_loop:validate",
            "Say whether a world tells good policies from lucky ones.",
        ),
        "study mechanism": Command(
            f"{_FURTHER}:Mechanism",
            "commands.studies.open_loop:mechanism",
            "Find why one policy finds what another misses, ray by ray.",
        ),
        "study firing": Command(
            f"{_FURTHER}:Firing",
            "commands.studies.either_loop:firing",
            "Show what a LiDAR that fires tiles, rows or a window decides.",
        ),
        "study realism": Command(
            f"{_FURTHER}:Realism",
            "commands.studies.either_loop:realism",
            "Show which orders of policies a real car's sensing keeps.",
        ),
        "study vehicle": Command(
            f"{_FURTHER}:Vehicle",
            "commands.studies.closed_loop:vehicle",
            "Play late evidence, a failing camera, a wrong pose.",
        ),
    },
    "Results": {
        "benchmark": Command(
            f"{_RESULTS}:Benchmark",
            "commands.benchmark:benchmark",
            "Play the official suite: one score, and a result file.",
        ),
        "leaderboard": Command(
            f"{_RESULTS}:Leaderboard",
            "commands.leaderboard:leaderboard",
            "Put result files in one table, or verify them.",
        ),
        "report": Command(
            f"{_RESULTS}:Report",
            "commands.report:report",
            "Print a study again, merge several, or make one page.",
        ),
        "judge": Command(
            f"{_RESULTS}:Judge",
            "commands.judge:judge",
            "Judge detectors: what they find, how much is right.",
        ),
        "export nuscenes": Command(
            f"{_RESULTS}:ExportNuScenes",
            "commands.export:export_nuscenes",
            "Write a policy's detections for the official nuScenes devkit.",
        ),
        "export minari": Command(
            f"{_RESULTS}:ExportMinari",
            "commands.export:export_minari",
            "Write a policy's episodes as a Minari dataset.",
        ),
    },
    "Learn": {
        "train ppo": Command(
            f"{_OPTIONS}.learning:TrainPpo",
            "commands.train:train",
            "Train the policy `ppo`; proximal policy.",
        ),
        "train sac": Command(
            f"{_OPTIONS}.learning:TrainSac",
            "commands.train:train",
            "Train an allocator by soft actor-critic.",
        ),
        "train recurrent-ppo": Command(
            f"{_OPTIONS}.learning:TrainRecurrentPpo",
            "commands.train:train",
            "Train an allocator with a memory (an LSTM).",
        ),
        "train learned-scorer": Command(
            f"{_WEIGHTS}:ScorerConfig",
            "training.scorer:train_learned_scorer",
            "Train `learned-scorer`.",
        ),
        "train learned-sets": Command(
            f"{_WEIGHTS}:SetsConfig", "training.sets:train_sets", "Train `learned-sets`."
        ),
        "train place": Command(
            f"{_WEIGHTS}:PlaceConfig",
            "training.place_map:train_place",
            "Make the map of the control `place`.",
        ),
        "train detector": Command(
            f"{_WEIGHTS}:DetectorConfig",
            "training.detector:train_pillars",
            "Train the detector `pillars`.",
        ),
        "train curves": Command(
            f"{_OPTIONS}.learning:Curves",
            "commands.curves:curves",
            "Draw the learning curves of training runs.",
        ),
    },
    "This installation": {
        "list": Command(
            f"{_WATCHING}:List",
            "commands.listings:show",
            "List policies, agents, scenarios, sources, sensors and more.",
        ),
        "certify": Command(
            "commands.certify:Certify",
            "",
            "Play published episodes and say whether they go as published.",
        ),
    },
}
"""By what they are for, in the order in which help shows them."""

COMMANDS = {name: command for group in GROUPS.values() for name, command in group.items()}

FAMILIES = {
    "study": "Play a study: `care-sim study --help` lists them.",
    "export": "Write data for other programs: detections, datasets.",
    "train": "Train a policy: `care-sim train --help` lists the learners.",
}
"""First words that need a second one, and what the commands behind them are for."""

_STUDY_NAMES = [name.split()[1] for name in COMMANDS if name.startswith("study ")]
_KINDS = ("policies", "agents", "scenarios", "sources", "detectors", "sensors")
RENAMED = {
    **{name: f"study {name}" for name in _STUDY_NAMES},
    **{kind: f"list {kind}" for kind in _KINDS},
    "enjoy": "run",
    "merge": "report",
    "collect": "export minari",
    "completion": "--tyro-print-completion",
}
"""Names up to version 0.2, which answer for one release."""
MOVED = {"bench": "make bench", "parity": "make parity"}
"""Commands of version 0.2 that are run in a clone now, since they measure the software itself."""
