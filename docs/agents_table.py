"""The table of agents in `docs/learning.md`, made from the cards of their weights.

`python docs/agents_table.py` writes it anew; a test says where it is not as the cards.
"""

import re
from pathlib import Path

from care_sim.training.agents import shipped_agents

PAGE = Path(__file__).parent / "learning.md"
_SHOWN = ("policy", "environment", "steps", "validation")
"""`care-sim list agents` prints the rest."""
_REGION = re.compile(r"<!-- agents -->\n.*?<!-- end -->", re.S)


def written(page: str) -> str:
    """The text of the page with the table as the cards are now."""
    rows = [agent.columns for agent in shipped_agents()]
    lines = [_SHOWN, ["---"] * len(_SHOWN), *([row[name] for name in _SHOWN] for row in rows)]
    table = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    return _REGION.sub(lambda _: f"<!-- agents -->\n{table}<!-- end -->", page)


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
