"""The commands of `care-sim` by name, grouped by what they are for: where each is, and the line
that `care-sim` shows of it.
"""

import importlib
from typing import Any, NamedTuple


class CommandEntry(NamedTuple):
    """Where a command is, and what `care-sim` says of it in one line."""

    module: str
    name: str
    about: str

    def loaded(self) -> Any:
        """The dataclass of its options, whose call runs it; or a table of several by name.

        Only the command that is asked for is imported: what plays, draws or learns takes seconds to
        import, for which `care-sim --help` and a mistyped name need not wait.
        """
        return getattr(importlib.import_module(f"care_sim.commands.{self.module}"), self.name)


GROUPS = {
    "Play and watch": {
        "run": CommandEntry("run", "Run", "Play one episode and print its timeline and outcome."),
        "compare": CommandEntry(
            "compare", "Compare", "Play one seed under several policies, side by side."
        ),
        "enjoy": CommandEntry(
            "enjoy", "Enjoy", "Play a trained agent: timeline, clip, recording or viewer."
        ),
        "view": CommandEntry("view", "View", "Open a recording in the Rerun viewer."),
    },
    "Report a result": {
        "benchmark": CommandEntry(
            "benchmark", "Benchmark", "Play the official suite: one score, and a result file."
        ),
        "leaderboard": CommandEntry(
            "leaderboard", "Leaderboard", "Put result files in one table, or verify them."
        ),
    },
    "Studies of the closed loop": {
        "reproduce": CommandEntry(
            "reproduce",
            "Reproduce",
            "Play the paper's study and print it beside the paper's figures.",
        ),
        "sweep": CommandEntry(
            "sweep", "Sweep", "Play every combination of scenarios, policies, budgets, faults."
        ),
        "ablate": CommandEntry(
            "ablate", "Ablate", "Vary one thing at a time, as the paper's ablations do."
        ),
        "order": CommandEntry(
            "order", "Order", "Play the paper's study under every order of cells in a set."
        ),
        "faults": CommandEntry(
            "faults", "Faults", "Let every fault grow until the order of the policies changes."
        ),
        "crowding": CommandEntry(
            "crowding", "Crowding", "Fill the dense street until the all-camera reserve collapses."
        ),
        "ncap": CommandEntry(
            "ncap", "Ncap", "Play the Euro NCAP tests: avoided, mitigated or hit; a score."
        ),
        "r157": CommandEntry("r157", "R157", "Play the preventable cut-ins of UN Regulation 157."),
        "validate": CommandEntry(
            "validate", "Validate", "Say whether a world tells good policies from lucky ones."
        ),
    },
    "Studies of the open loop": {
        "protocol": CommandEntry(
            "protocol", "Protocol", "Play the first-sighting protocol, on streets or recordings."
        ),
        "mechanism": CommandEntry(
            "mechanism", "Mechanism", "Find why one policy finds what another misses, ray by ray."
        ),
        "judge": CommandEntry(
            "judge",
            "Judge",
            "Judge detectors: what they find, and how much of it is right.",
        ),
        "export": CommandEntry(
            "export", "Export", "Write a policy's detections for the official nuScenes devkit."
        ),
    },
    "Hardware and car": {
        "firing": CommandEntry(
            "firing", "Firing", "Tell what a LiDAR that fires tiles, rows or a window decides."
        ),
        "realism": CommandEntry(
            "realism", "Realism", "Tell which orders of policies a real car's sensing keeps."
        ),
        "vehicle": CommandEntry(
            "vehicle", "Vehicle", "Play late evidence, a failing camera, a wrong pose."
        ),
    },
    "Learn": {
        "collect": CommandEntry(
            "collect", "Collect", "Write a policy's episodes as a Minari dataset."
        ),
        "train": CommandEntry(
            "train", "LEARNERS", "Train a policy: `care-sim train --help` lists the learners."
        ),
    },
    "Show results": {
        "report": CommandEntry(
            "report", "PrintReport", "Print a folder's tables and figures again, or make one page."
        ),
        "merge": CommandEntry(
            "merge", "Merge", "Put folders of one study in one, so that tables compare them."
        ),
    },
    "What there is": {
        "policies": CommandEntry(
            "listings", "Policies", "List the policies: tags, parameters, sources."
        ),
        "agents": CommandEntry("listings", "Agents", "List the trained agents of the package."),
        "scenarios": CommandEntry(
            "listings", "Scenarios", "List the scenarios and their parameters."
        ),
        "sources": CommandEntry(
            "listings", "Sources", "List the sources of scenes for the open loop."
        ),
        "detectors": CommandEntry("listings", "Detectors", "List the detectors."),
        "sensors": CommandEntry("listings", "Sensors", "List the sensor set-ups."),
        "completion": CommandEntry(
            "completion", "Completion", "Print what completes commands and options in a shell."
        ),
    },
    "Is this installation sound?": {
        "certify": CommandEntry(
            "certify", "Certify", "Play published episodes and say whether they go as published."
        ),
    },
}
"""The groups of `docs/commands.md`, in its order."""

COMMANDS = {name: entry for group in GROUPS.values() for name, entry in group.items()}
