"""The index of the published rows, `results/data/README.md`, made from the folders.

`python docs/results_index.py` writes it anew; a test fails when it is out of date.
"""

import json
import re
from pathlib import Path

from pyarrow.parquet import read_metadata

RESULTS = Path(__file__).parents[1] / "results"
PAGE = RESULTS / "data" / "README.md"
_HEAD = """# Published rows

A folder holds the rows of one study, their tables, and `config.json`: command, settings, seeds,
versions, a hash of the code, the machine. `care-sim report FOLDER` makes tables and figures again.
[Columns](../../docs/rows.md).

`b90` holds the tables of the [benchmark](../b90.md) (`python docs/b90_results.py`). Its entries are
in `care_sim/study/benchmark/references`. `judge-streets` and `judge-logs` hold results of
`care-sim judge` on [detectors](../detectors.md). `make bench` and `make parity` write `bench.json`
and `parity.json`.

*Version* is the version of CARE-Sim that played the rows. Version 0.3.0 draws another random floor,
so older rows differ from a new run. `make publish` plays all rows again.

| folder | version | rows | pages |
|---|---|---|---|
"""
_COMMANDS = """
## Commands

```bash
"""
_ROWS = ("episodes.parquet", "plays.parquet", "vehicle.parquet")


def written() -> str:
    """The text of the index as the folders are now."""
    pages = {
        page: page.read_text(encoding="utf-8")
        for page in sorted(RESULTS.glob("*.md"))
        if page.name not in ("README.md", "findings.md")
    }
    lines, commands = [], []
    for path in sorted(PAGE.parent.glob("*/config.json")):
        folder = path.parent
        config = json.loads(path.read_text(encoding="utf-8"))
        command, version = config["command"], config["versions"]["care-sim"]
        (rows,) = (
            read_metadata(file).num_rows for file in map(folder.joinpath, _ROWS) if file.is_file()
        )
        cites = re.compile(rf"\(data/{folder.name}/")
        cited = [
            f"[{page.stem}](../{page.name})" for page, text in pages.items() if cites.search(text)
        ]
        name = f"[{folder.name}]({folder.name}/tables.md)"
        lines.append(f"| {name} | {version} | {rows:,} | {', '.join(cited)} |\n")
        commands.append(f"# {folder.name}\n{command}\n")
    return _HEAD + "".join(lines) + _COMMANDS + "".join(commands) + "```\n"


if __name__ == "__main__":
    PAGE.write_text(written(), encoding="utf-8")
