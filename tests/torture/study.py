"""A small real study, its rows when nobody disturbs it, and the question whether a folder holds
those, each once.
"""

import json
from functools import lru_cache

from tests.torture import props
from tests.torture.case import Fault

MEASURED = {"wall_s", "peak_rss_mb"}
"""Columns that time and memory decide."""
SEEDS = 6
ARGUMENTS = (
    *("sweep", "--scenarios", "dartout", "--policies", "history", "care", "--seeds", str(SEEDS)),
    *("--scenario-parameters", "duration_s=0.5"),
)
ROWS = 2 * SEEDS
JOURNAL, ROWS_FILE = "journal.jsonl", "episodes.parquet"


def command(out, workers=2):
    """The arguments of the study."""
    return [*ARGUMENTS, "--workers", str(workers), "--out", str(out)]


@lru_cache(maxsize=1)
def undisturbed():
    """The folder of the study that nobody disturbed."""
    return props.template("undisturbed")


@lru_cache(maxsize=1)
def expected():
    """Its rows."""
    return steady(undisturbed())


def steady(folder):
    """The rows in a folder without what is measured."""
    from care_sim.study.rows.parquet import read_rows

    return [
        {name: value for name, value in row.items() if name not in MEASURED}
        for row in read_rows(folder / ROWS_FILE)
    ]


def check_whole(folder, once=True):
    """A fault unless the folder holds every row of the study once, in order, equal to the
    undisturbed ones.
    """
    rows = steady(folder)
    key = [(row["policy"], row["seed"]) for row in rows]
    wanted = [(row["policy"], row["seed"]) for row in expected()]
    if sorted(key) != sorted(set(key)):
        raise Fault("a row repeated", str(key))
    if set(wanted) - set(key):
        raise Fault("a row lost", str(sorted(set(wanted) - set(key))))
    for ours, theirs in zip(rows, expected(), strict=True):
        names = [one for one in ours | theirs if repr(ours.get(one)) != repr(theirs.get(one))]
        if names:
            wrong = {name: (ours.get(name), theirs.get(name)) for name in sorted(names)}
            what = f"{theirs['policy']} {theirs['seed']}: (is, should be) {wrong}"
            raise Fault("a row wrong", what, ", ".join(wrong))
    if once:
        _check_played_once(folder)
    left = sorted(path.name for path in folder.iterdir() if path.name.startswith("."))
    if left:
        raise Fault("files left over", str(left))


def _check_played_once(folder):
    """No episode was computed again that the journal held."""
    digests = []
    for line in (folder / JOURNAL).read_text(errors="replace").splitlines():
        try:
            digests.append(json.loads(line)["digest"])
        except (ValueError, KeyError, TypeError):
            continue
    twice = {digest for digest in digests if digests.count(digest) > 1}
    if twice:
        raise Fault("an episode played again that was in the journal", str(sorted(twice)))


def check_not_torn(folder):
    """A fault if a file that readers open is there but not whole."""
    from care_sim.base.errors import InvalidInput

    try:
        if (folder / ROWS_FILE).exists():
            steady(folder)
        if (folder / "config.json").exists():
            json.loads((folder / "config.json").read_text())
    except (InvalidInput, ValueError) as error:
        raise Fault("a file torn", str(error), folder.name) from error
