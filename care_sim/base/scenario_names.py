"""What a scenario is called whose environment has an id: `CARE-CutIn-v0` is that of `cutin`."""

import re

SCENARIO_GROUP = "care_sim.scenarios"
"""Entry points of scenarios, called as the scenario is or by the id of its environment."""
_ID = re.compile(r"\w+-(\w+)-v\d+")


def is_environment_id(name: str) -> bool:
    """Whether a name has the form of an environment's id, `Mine-LeftBike-v0`."""
    return _ID.fullmatch(name) is not None


def scenario_of(name: str) -> str:
    """The scenario of an environment's id; any other name is the scenario's own."""
    told = _ID.fullmatch(name)
    return told[1].lower() if told else name
