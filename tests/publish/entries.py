"""Play the published entries of the benchmark again, and replace their files."""

from collections import Counter

from care_sim.base.files import replacing
from care_sim.reports.budgets import budgets_table
from care_sim.reports.figures.budgets import BUDGETS_FIGURE, budgets_figure
from care_sim.reports.figures.styles import save
from care_sim.study.benchmark.budgets import MAIN_DETECTOR, REFERENCE_ENTRIES
from care_sim.study.benchmark.result import publish_references, read_result
from tests.helpers.places import PUBLISHED

FOLDER = PUBLISHED / "b90"


def by_entry(folder):
    """The results of a folder by their entry, in the order of the published ones."""
    found = {read_result(path).entry: path for path in folder.glob("*.json")}
    return {entry: found[entry] for entry in REFERENCE_ENTRIES if entry in found}


def commands():
    """The words that play each entry, without where its file goes."""
    for entry in REFERENCE_ENTRIES:
        words = ["care_sim", "benchmark", "--policy", entry.policy]
        if entry.parameters:
            pairs = [f"{name}={value}" for name, value in entry.parameters]
            words += ["--policy-parameters", *pairs]
        yield [*words, "--cell-order", entry.cell_order]


def publish_entries(made):
    """Replace the entries by those in the folder `made`; returns the lines that say what changed.

    Raises KeyError where an entry is missing in `made`.
    """
    old, new = by_entry(FOLDER), by_entry(made)
    new = {entry: new[entry] for entry in REFERENCE_ENTRIES}
    lines = []
    for entry in REFERENCE_ENTRIES:
        before, after = (
            Counter(map(str, read_result(each[entry]).rows)) if entry in each else Counter()
            for each in (old, new)
        )
        lines.append(
            f"{entry.full_name}: {(after - before).total()} of {after.total()} rows differ"
        )
    results = [read_result(path) for path in new.values()]
    publish_references(results)
    save(budgets_figure(results), made / BUDGETS_FIGURE)
    for path in (*new.values(), made / f"{BUDGETS_FIGURE}.svg"):
        copy_to_folder(path)
    return [*lines, budgets_table(results).markdown()]


def copy_to_folder(path):
    """Copy a file that was made to the published ones, under the name that it has there."""
    with replacing(FOLDER / path.name.replace(f".{MAIN_DETECTOR}", "")) as unfinished:
        unfinished.write_bytes(path.read_bytes())
