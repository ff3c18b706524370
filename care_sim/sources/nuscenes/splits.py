"""Which scenes a split holds: the official validation split, and those of `splits.json`."""

from pathlib import Path

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput
from care_sim.sources.nuscenes.table_files import JsonRow, read_json
from care_sim.sources.nuscenes.tables import Database

_VAL_NUMBERS = (
    (3, 3),
    (12, 18),
    (35, 36),
    (38, 39),
    (92, 110),
    (221, 221),
    (268, 278),
    (329, 332),
    (344, 346),
    (519, 524),
    (552, 565),
    (625, 627),
    (629, 630),
    (632, 638),
    (770, 771),
    (775, 775),
    (777, 778),
    (780, 784),
    (794, 800),
    (802, 802),
    (904, 917),
    (919, 931),
    (962, 963),
    (966, 969),
    (971, 972),
    (1059, 1073),
)

VAL = tuple(
    f"scene-{number:04}" for first, last in _VAL_NUMBERS for number in range(first, last + 1)
)
"""The 150 scenes of the official validation split (nuScenes devkit, utils/splits.py)."""


def scenes(database: Database, split: str = "val") -> list[JsonRow]:
    """The scenes of a split that the database holds: of `val`, of `all`, or of a split in
    `<root>/<version>/splits.json`, a map from names of splits to lists of names of scenes.

    Raises InvalidInput for an unknown split, a scene of `splits.json` that the database lacks, and
    an empty split.
    """
    by_name = {row["name"]: row for row in database.rows("scene").values()}
    # The official split names scenes of which a database may hold a few; a split of its own must be
    # whole, and comes before an official one of the same name.
    own = _own_splits(database)
    known = {"all": sorted(by_name), "val": [name for name in VAL if name in by_name], **own}
    check_known("split", split, known)
    for name in known[split]:
        if name not in by_name:
            where = _own_file(database)
            table = database.path("scene")
            raise InvalidInput(f"{where}: the split {split!r} names {name!r}, which {table} lacks")
    if not known[split]:
        held = (
            ", ".join(
                name for name, names in known.items() if names and by_name.keys() >= set(names)
            )
            or "none"
        )
        raise InvalidInput(
            f"{database.path('scene')}: holds no scene of the split {split!r}; splits it holds: "
            f"{held}"
        )
    return [by_name[name] for name in known[split]]


def _own_file(database: Database) -> Path:
    return database.folder / "splits.json"


def _own_splits(database: Database) -> dict[str, list[str]]:
    path = _own_file(database)
    splits = read_json(path) if path.exists() else {}
    if not isinstance(splits, dict):
        raise InvalidInput(f"{path}: must map names of splits to lists of names of scenes")
    for split, names in splits.items():
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise InvalidInput(f"{path}: the split {split!r} must be a list of names of scenes")
        if len(set(names)) < len(names):
            raise InvalidInput(f"{path}: the split {split!r} names a scene twice")
    return splits
