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

Every folder holds the rows of one study, its tables, and `config.json`: the command,
configurations, seeds, versions, a hash of the code, the machine. `care-sim report FOLDER` makes all
tables and figures again. [How to read the rows](../../docs/rows.md).

Beside them lie `b90`, the tables of the [benchmark](../b90.md) (`python docs/b90_results.py`; its
entries are in `care_sim/study/benchmark/references.json`), `judge-streets` and
`judge-logs`, what `care-sim judge` says of [detectors](../detectors.md), and `bench.json` and
`parity.json`, of `make bench` and `make parity`.

The column *version* names the version of CARE-Sim that played the rows. Version 0.3.0 draws another
random floor, so rows of earlier versions differ from what their commands play today. `make publish`
plays them again.

| folder | command | version | rows | pages |
|---|---|---|---|---|
"""
_ROWS = ("episodes.parquet", "plays.parquet", "vehicle.parquet")


def written() -> str:
    """The text of the index as the folders are now."""
    pages = {
        page: page.read_text(encoding="utf-8")
        for page in sorted(RESULTS.glob("*.md"))
        if page.name not in ("README.md", "findings.md")
    }
    lines = []
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
        lines.append(f"| {name} | `{command}` | {version} | {rows:,} | {', '.join(cited)} |\n")
    return _HEAD + "".join(lines)


if __name__ == "__main__":
    PAGE.write_text(written(), encoding="utf-8")
