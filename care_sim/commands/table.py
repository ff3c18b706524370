"""The commands of `care-sim` by name: where their options and what they do are, and the line that
help shows. Only the command that is asked for is imported.
"""

import importlib
from typing import Any, NamedTuple


class Command(NamedTuple):
    """A command: the class of its options, the function that takes them, and what it is for.

    Both are MODULE:NAME in `care_sim`.
    """

    options: str
    run: str
    about: str

    def options_class(self) -> Any:
        """The class of its options."""
        return _loaded(self.options)

    def function(self) -> Any:
        """Return the function that runs the options and returns an exit code."""
        return _loaded(self.run)


def _loaded(place: str) -> Any:
    module, name = place.split(":")
    return getattr(importlib.import_module(f"care_sim.{module}"), name)


def _own(options: str, run: str, about: str) -> Command:
    """A command whose options and function are both in `commands`."""
    return Command(f"commands.options.{options}", f"commands.{run}", about)


def _study(options: str, run: str, about: str) -> Command:
    return _own(f"studies:{options}", f"studies:{run}", about)


GROUPS: dict[str, dict[str, Command]] = {
    "Play and watch": {
        "run": _own("watching:Run", "run:run", "Play one episode; also a trained agent."),
        "compare": _own(
            "watching:Compare", "compare:compare", "Play one seed under several policies."
        ),
        "view": _own("watching:View", "run:view", "Open a recording in the Rerun viewer."),
    },
    "Studies": {
        "reproduce": _study(
            "Reproduce",
            "reproduce",
            "Play the paper's study beside the paper's figures.",
        ),
        "sweep": _study(
            "Sweep",
            "sweep",
            "Play every combination of scenarios, policies, budgets, faults.",
        ),
        "protocol": _study(
            "Protocol",
            "protocol",
            "Play the first-sighting protocol, on streets or recordings.",
        ),
        "study ablate": _study(
            "Ablate", "ablate", "Vary one thing at a time, as the paper's ablations do."
        ),
        "study order": _study(
            "Order",
            "order",
            "Play the paper's study under every order of cells in a set.",
        ),
        "study faults": _study(
            "Faults",
            "faults",
            "Let every fault grow until the order of the policies changes.",
        ),
        "study crowding": _study(
            "Crowding",
            "crowding",
            "Fill the dense street until the all-camera reserve collapses.",
        ),
        "study ncap": _study(
            "Ncap",
            "ncap",
            "Play the Euro NCAP tests: avoided, mitigated or hit; a score.",
        ),
        "study r157": _study("R157", "r157", "Play the preventable cut-ins of UN Regulation 157."),
        "study validate": _study(
            "Validate",
            "validate",
            "Say whether a world tells good policies from lucky ones.",
        ),
        "study mechanism": _study(
            "Mechanism",
            "mechanism",
            "Find why one policy finds what another misses, ray by ray.",
        ),
        "study firing": _study(
            "Firing",
            "firing",
            "Show what a LiDAR that fires tiles, rows or a window decides.",
        ),
        "study realism": _study(
            "Realism",
            "realism",
            "Show which orders of policies a real car's sensing keeps.",
        ),
        "study vehicle": _study(
            "Vehicle", "vehicle", "Play late evidence, a failing camera, a wrong pose."
        ),
    },
    "Results": {
        "benchmark": _own(
            "results:Benchmark",
            "benchmark:benchmark",
            "Play the benchmark: how few cells are enough, a result file.",
        ),
        "leaderboard": _own(
            "results:Leaderboard",
            "leaderboard:leaderboard",
            "Put result files in one table, or verify them.",
        ),
        "report": _own(
            "results:Report",
            "report:report",
            "Print a study again, merge several, or make one page.",
        ),
        "judge": _own(
            "results:Judge", "judge:judge", "Judge detectors: what they find, how much is right."
        ),
        "export nuscenes": _own(
            "results:ExportNuScenes",
            "export:export_nuscenes",
            "Write a policy's detections for the official nuScenes devkit.",
        ),
        "export minari": _own(
            "results:ExportMinari",
            "export:export_minari",
            "Write a policy's episodes as a Minari dataset.",
        ),
    },
    "Learn": {
        "train ppo": _own(
            "learning:TrainPpo", "train:train", "Train the policy `ppo`; proximal policy."
        ),
        "train sac": _own(
            "learning:TrainSac", "train:train", "Train an allocator by soft actor-critic."
        ),
        "train recurrent-ppo": _own(
            "learning:TrainRecurrentPpo",
            "train:train",
            "Train an allocator with a memory (an LSTM).",
        ),
        "train learned-scorer": _own(
            "learning:TrainScorer", "train_on_films:train_scorer", "Train `learned-scorer`."
        ),
        "train learned-sets": _own(
            "learning:TrainSets", "train_on_films:train_sets", "Train `learned-sets`."
        ),
        "train place": Command(
            "training.supervised.options:PlaceConfig",
            "training.supervised.place:train_place",
            "Make the map of the control `place`.",
        ),
        "train tuned-place": Command(
            "training.supervised.options:TunedPlaceConfig",
            "training.supervised.tuned_place:train_tuned_place",
            "Make the map of the control `tuned-place`.",
        ),
        "train detector": _own(
            "learning:TrainDetector",
            "train_on_films:train_detector",
            "Train the detector `pillars`.",
        ),
        "train curves": _own(
            "learning:Curves", "train:curves", "Draw the learning curves of training runs."
        ),
    },
    "This installation": {
        "list": _own(
            "watching:List",
            "listings:show",
            "List policies, agents, scenarios, sources, sensors and more.",
        ),
        "certify": _own(
            "results:Certify",
            "certify:certify",
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

_STUDIES = (
    *("ablate", "crowding", "faults", "firing", "mechanism", "ncap", "order", "r157", "realism"),
    *("validate", "vehicle"),
)
_KINDS = ("policies", "agents", "scenarios", "sources", "detectors", "sensors")
RENAMED = {
    **{name: f"study {name}" for name in _STUDIES},
    **{kind: f"list {kind}" for kind in _KINDS},
    "enjoy": "run",
    "merge": "report",
    "collect": "export minari",
    "completion": "--tyro-print-completion",
}
"""Names up to version 0.2, which answer for one release."""
MOVED = {"bench": "make bench", "parity": "make parity"}
"""Commands of version 0.2 that are run in a clone now, since they measure the software itself."""
