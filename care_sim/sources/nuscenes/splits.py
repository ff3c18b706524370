"""Which scenes a split holds: the official splits, and those of `splits.json`."""

from pathlib import Path

from care_sim.base.checks import check_known
from care_sim.base.errors import InvalidInput
from care_sim.sources.film_checks import report_once
from care_sim.sources.nuscenes.table_files import JsonRow, read_json
from care_sim.sources.nuscenes.tables import Database

# Runs of scene numbers.
_OFFICIAL = {
    "train": """
1-2 4-11 19-34 41-76 120-135 138-139 149-152 154-155 157-168 170-185 187-188 190-196 199-200
202-204 206-214 218-220 222 224-264 283-306 315-318 321 323-324 328 347-386 388-403 405-408
410-459 461-465 467-469 471-472 474-480 499-502 504-515 517-518 525-539 541-546 566 568 570-578
580 582-600 639-679 681 683-689 695-698 700-701 703-719 726-728 730-731 733-741 744 746-747
749-752 757-765 767-769 786-787 789-792 803-806 808-813 815-817 819-822 847-856 858 860-866
868-873 875-878 880 882-903 945 947 949 952-953 955-961 975-984 988-992 994-1025 1044-1058
1074-1102 1104-1110
""",
    "val": """
3 12-18 35-36 38-39 92-110 221 268-278 329-332 344-346 519-524 552-565 625-627 629-630 632-638
770-771 775 777-778 780-784 794-800 802 904-917 919-931 962-963 966-969 971-972 1059-1073
""",
    "mini_train": "61 553 655 757 796 1077 1094 1100",
    "mini_val": "103 916",
}

MOST_NAMED = 3
"""Missing scenes that a line names."""


def _names(runs: str) -> tuple[str, ...]:
    ends = [[int(end) for end in run.split("-")] for run in runs.split()]
    return tuple(f"scene-{number:04}" for run in ends for number in range(run[0], run[-1] + 1))


OFFICIAL = {split: _names(runs) for split, runs in _OFFICIAL.items()}
"""The scenes of the official splits with published boxes (nuScenes devkit, utils/splits.py). The
split `test` has none.
"""


def scenes(database: Database, split: str = "val") -> list[JsonRow]:
    """The scenes of a split that the database holds: of an official split, of `all`, or of a split
    in `<root>/<version>/splits.json`, a map from names of splits to lists of names of scenes.

    Raises InvalidInput for an unknown split, a scene of `splits.json` that the database lacks, and
    an empty split.
    """
    by_name = {row["name"]: row for row in database.rows("scene").values()}
    # An official split names scenes of which a database may hold a few; a split of its own must be
    # whole, and comes before an official one of the same name.
    held = {name: [one for one in names if one in by_name] for name, names in OFFICIAL.items()}
    known = {"all": sorted(by_name), **held, **_own_splits(database)}
    check_known("split", split, known)
    for name in known[split]:
        if name not in by_name:
            where = _own_file(database)
            table = database.path("scene")
            raise InvalidInput(f"{where}: the split {split!r} names {name!r}, which {table} lacks")
    if not known[split]:
        some = ", ".join(
            name for name, names in known.items() if names and by_name.keys() >= set(names)
        )
        raise InvalidInput(
            f"{database.path('scene')}: holds no scene of the split {split!r}; splits it holds: "
            f"{some or 'none'}"
        )
    return [by_name[name] for name in known[split]]


def tell_missing(database: Database, split: str) -> None:
    """Print a line once where the database holds only some scenes of an official split."""
    names = () if split in _own_splits(database) else OFFICIAL.get(split, ())
    held = {row["name"] for row in database.rows("scene").values()}
    missing = [name for name in names if name not in held]
    if missing:
        more = len(missing) - MOST_NAMED
        report_once(
            f"{database.path('scene')}: holds {len(names) - len(missing)} of the {len(names)} "
            f"scenes of the split {split}; missing: {', '.join(missing[:MOST_NAMED])}"
            + (f" and {more} more" if more > 0 else "")
        )


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
