"""The pages of the results: every folder has its line in the index and its place on the page of a
question, which begins with the answer.
"""

import json
import re
import shlex
from collections import Counter
from itertools import combinations

import pytest

from care_sim import cli
from care_sim.base.seeds import split_of
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, ratio_level
from care_sim.evaluation.smallest_budget import budget_ratio
from care_sim.policies import BUILT_IN
from care_sim.reports.budgets import format_budget, sorted_by_budget
from care_sim.reports.statements import TIED, TURNS_OVER, statement
from care_sim.study.benchmark.bounds import BOUNDS
from care_sim.study.benchmark.budgets import (
    MAIN_DETECTOR,
    REFERENCE_ENTRIES,
    budget_worlds,
)
from care_sim.study.benchmark.result import read_list, references
from care_sim.study.benchmark.suite import STREETS, Entry
from care_sim.study.results_formats import EPISODES
from care_sim.study.rows.parquet import read_rows
from care_sim.study.run_config import FULL
from tests.helpers.places import EXAMPLES, RESULTS, ROOT, fenced, links, loaded

FOLDER = ROOT / "results"
DATA = FOLDER / "data"
INDEX = FOLDER / "README.md"
QUESTIONS = [page for page in RESULTS if page.name not in ("README.md", "findings.md")]


def commands(page):
    """The commands of a page, one line each."""
    lines = "".join(fenced(page, "bash")).replace("\\\n", " ").splitlines()
    return [line for line in lines if line.startswith("care-sim ")]


def test_every_picture_has_a_command_in_the_index():
    pictures = {file.name for ending in ("gif", "png") for file in FOLDER.glob(f"*.{ending}")}
    made = re.findall(r"--(?:video|picture) results/(\S+)", "\n".join(commands(INDEX)))
    assert sorted(made) == sorted(pictures)


@pytest.mark.parametrize("name", sorted(path.name for path in DATA.iterdir() if path.is_dir()))
def test_a_folder_has_its_place_on_the_page_of_a_question(name):
    assert any(f"(data/{name}/" in page.read_text() for page in QUESTIONS)


def test_the_index_of_the_rows_is_of_the_folders():
    # An index that is not as the folders: python docs/results_index.py
    index = loaded(ROOT / "docs" / "results_index.py").written()
    assert index == (DATA / "README.md").read_text()


def test_commands_beside_pictures_and_rows_are_understood():
    rows = DATA / "README.md"
    folders = re.findall(r"^\| \[([\w-]+)\]", rows.read_text(), re.M)
    assert len(commands(rows)) == len(folders) > 5
    for command in (*commands(INDEX), *commands(rows)):
        numbered = re.sub(r"\$\(seq (\d+) (\d+)\)", listed, command)
        cli.parsed_command(shlex.split(numbered)[1:])


def listed(sequence):
    """The numbers that the shell puts in the place of `$(seq FIRST LAST)`."""
    first, last = map(int, sequence.groups())
    return " ".join(map(str, range(first, last + 1)))


@pytest.mark.parametrize("page", QUESTIONS, ids=lambda page: page.stem)
def test_a_page_asks_answers_and_has_limitations(page):
    text = page.read_text()
    question, answer, *_ = text.split("\n\n")
    assert re.fullmatch(r"# .*\?", question)
    assert answer.startswith("**")
    assert re.search(r"^## (Limitations|What does not hold)$", text, re.M)


@pytest.mark.parametrize("page", QUESTIONS, ids=lambda page: page.stem)
def test_the_index_and_the_site_lead_to_every_page(page):
    assert page.name in links(INDEX)
    assert f": results/{page.name}\n" in (ROOT / ".mkdocs.yml").read_text()


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_the_first_page_names_scores_as_they_are(page):
    text = " ".join((ROOT / page).read_text().split())
    told = dict(re.findall(r"`([\w-]+)` \(([\d.]+%|never)\)", text))
    scores = {
        one.entry.name: f"{format_budget(one.score.budget)}%".replace("never%", "never")
        for one in references(MAIN_DETECTOR)
    }
    assert len(told) >= 5
    assert told.items() <= scores.items()
    # "A, B and C tie. The paper's D needs more than A, and ties with E."
    claim = text.partition("**Our rules ")[2].partition(" needs more than ")
    *tied, more = re.findall(r"`([\w-]+)`", claim[0])
    fewer, alike, *_ = re.findall(r"`([\w-]+)`", claim[2])
    columns = {MAIN_DETECTOR: references(MAIN_DETECTOR)}
    assert len(tied) == 3
    assert {statement(columns, *pair).verdict for pair in combinations(tied, 2)} == {TIED}
    assert statement(columns, fewer, more).fewer == (MAIN_DETECTOR,)
    assert statement(columns, more, alike).verdict == TIED
    # The worth of the residual in two rules, on the streets of the trial.
    older, newer = (
        float(row[4].split()[0])
        for table in loaded(ROOT / "docs" / "b90_results.py").trial()[:2]
        for row in table.rows
        if row[0] == "without residual"
    )
    worth = f"`care-sector` needs {older:.1f} times as many rays, and `care-aimed` {newer} times"
    assert page != "README.md" or f"Without it, on 24 streets, {worth}" in text


def test_the_table_of_b90_is_that_of_the_published_entries():
    script = loaded(ROOT / "docs" / "b90_results.py")
    ordered = references(MAIN_DETECTOR)
    results = {one.entry: one.of_part(STREETS) for one in ordered}
    assert [*results] == [*REFERENCE_ENTRIES, *BOUNDS]
    # Files say of entries, for people, the same as their rows.
    told = json.loads((ROOT / "care_sim/study/benchmark/references/centerpoint.json").read_text())
    assert [one["held_back_by"] for one in told] == [one.held_back_by for one in ordered]
    streets = tuple((STREETS, seed) for seed in budget_worlds()[STREETS])
    assert {one.worlds for one in results.values()} == {streets}
    tables = script.written()
    assert (DATA / "b90" / "tables.md").read_text() == tables
    text = (FOLDER / "b90.md").read_text()
    # A table that is not as the files: python docs/b90_results.py --tables
    assert script.with_table(text) == text
    page = " ".join(text.split())
    _, pairs = script.statements(script.DETECTORS)
    turned = [first_two for *first_two, verdict, _, _, _, _ in pairs.rows if TURNS_OVER in verdict]
    assert len(turned) == 5
    assert "**Five pairs change their order among the first four.**" in page
    told = page.partition("**Five pairs ")[2].partition("## ")[0]
    assert {f"`{name}`" for pair in turned for name in pair} <= {*re.findall(r"`[\w-]+`", told)}
    fresh = [one for one in read_list(script.FRESH) if one.entry.policy != "place"]
    told = [f"`{one.entry.name}` {format_budget(one.score.budget)}" for one in fresh]
    assert ", ".join(told) in page
    orders = [
        [one.entry for one in sorted_by_budget(own) if one.entry.policy != "tuned-place"]
        for own in (fresh, [results[one.entry] for one in fresh])
    ]
    assert orders[0] == orders[1]
    assert [one.entry for one in sorted_by_budget(fresh)] == [one.entry for one in fresh]
    _, newest, *_ = script.trial()
    (worth,) = (row[4:] for row in newest.rows if row[0] == "without residual")
    assert f"| `care-aimed` (on 24 streets) | {' | '.join(map(str, worth))} |" in page
    small = script.small_budgets().rows
    _, _, found, by_all, more, *_, kept, kept_without, _ = small[5][:11]
    assert small[5][:2] == ("care core-spread", "1%")
    assert (
        f"`care core-spread` detects {found}% of the emerging newcomers, and `all-camera "
        f"core-spread` {by_all}% ({more.replace(' ', ' points ', 1)}). It keeps {kept}% of the "
        f"objects, not {kept_without}%."
    ) in page
    gains = [float(more.split()[0]) for row in small[5:] for more in (row[4], *row[11:])]
    assert f"the gain is {min(gains):.0f} to {max(gains):.0f} points under the first four" in page
    assert small[1][:2] == ("care-sector", "1%")
    gain, loss = (float(small[1][column].split()[0]) for column in (4, 10))
    assert f"the residual gains {gain} points at 1%, but {-loss} points fewer objects" in page
    boxes = results[Entry("boxes")].counts[0]
    emerging, _, kept, _ = boxes.got[:, 1].sum(axis=0) / boxes.full.sum(axis=0)
    assert f"`boxes` detects {emerging:.0%} and keeps {kept:.0%}." in page
    findings = " ".join((FOLDER / "findings.md").read_text().split())
    assert f"`care` detects {found}% of the nearby newcomers" in findings
    assert f"`all-camera`, which uses all camera boxes, detects {by_all}%" in findings
    tight = {one.entry.name: format_budget(one.score.budget) for one in read_list(script.TIGHT)}
    told = re.findall(r"`([\w-]+)` \(([\d.]+)%\)", page.partition("count collisions.**")[2])
    assert len(told) == 4
    assert {*told} <= {*tight.items()}
    assert [tight[name] for name in ("care", "all-camera core-spread")] == ["never", "never"]
    # Ratios to other entries than the tables', and what a full scan has.
    rows, care, core_first, all_camera, whole, without = (
        next(one for one in ordered if one.entry == entry)
        for entry in (
            *map(Entry, ("rows", "care")),
            *(Entry(name, cell_order="core-spread") for name in ("care", "all-camera")),
            Entry("care-sector"),
            Entry("care-sector", (("residual", False),)),
        )
    )
    beside = [
        (ours.of_part(part).counts, theirs.of_part(part).counts)
        for ours, theirs in ((rows, care), (all_camera, core_first), (without, whole))
        for part in rows.parts
    ]
    beside += [(rows.counts, care.counts)]
    told = []
    for pair in beside:
        ratio, low, high = budget_ratio(*pair)
        told.append(f"{ratio:.2f} [{low:.2f}, {high:.2f}]")
    tables += " ".join(told)
    for line, name in (
        (3, "`care core-spread`, without: `all-camera core-spread`"),
        (6, "`care-sector`"),
    ):
        assert f"| {name} | {' | '.join(told[line : line + 3])} |" in page
    ratios = re.findall(r"\d\.\d\d \[\d\.\d\d, \d\.\d\d\]", page)
    assert len(ratios) >= 5
    assert [ratio for ratio in ratios if ratio not in tables] == []
    for part in ordered[0].counts:
        emerging, entering, *_ = part.full.sum(axis=0)
        assert f"{emerging:.0f} emerging and {entering:.0f} entering newcomers" in page


def test_the_page_of_the_leaderboard_is_that_of_the_published_entries(tmp_path, capsys):
    # A page that is not as the entries: care-sim leaderboard --out results/data/b90
    with pytest.raises(SystemExit) as end:
        cli.main(["leaderboard", "--out", str(tmp_path)])
    assert end.value.code == 0
    capsys.readouterr()
    for name in ("leaderboard.md", "leaderboard.svg"):
        assert (tmp_path / name).read_text() == (DATA / "b90" / name).read_text()


def test_every_policy_is_a_published_entry_or_the_index_says_why_not():
    section = INDEX.read_text().partition("\n## Policies without B90\n")[2]
    reasons = re.findall(r"^- ([^:]+):", section.partition("\n## ")[0], re.M)
    without = {name for reason in reasons for name in re.findall(r"`([\w-]+)`", reason)}
    entered = {entry.policy for entry in REFERENCE_ENTRIES}
    assert not without & entered
    assert without | entered == {*BUILT_IN}


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_the_first_page_counts_the_collisions_of_other_drives(page):
    rows = read_rows(DATA / "validate-drive" / EPISODES.file)
    rows = [row for row in rows if row["budget"] == 0.03]
    seeds = {row["seed"] for row in rows if row["policy"] == "history"}
    hits = Counter(row["policy"] for row in rows if row["seed"] in seeds and row["collision"])
    told = (
        f"In {len(seeds)} other drives, `history` collides in {hits['history']} and `care` in "
        f"{hits['care']}. A fixed fan of rays straight ahead, without a camera, collides in only "
        f"{hits['fan']}."
    )
    assert told in " ".join((ROOT / page).read_text().split())


def table_rows(page):
    """The rows of the first table of a page, heading first, without bold and code."""
    lines = re.search(r"(?:^\|.*\n)+", page.read_text(), re.M)[0].splitlines()
    cells = [re.sub(r"[*`]", "", line).strip("|").split("|") for line in lines]
    return [[cell.strip() for cell in row] for row in cells if "---" not in row]


def test_newcomers_on_streets_are_those_of_the_rows():
    levels = (DATA / "streets" / "tables.md").read_text()
    (_, _, *budgets), (_, _, full, *_), *rows = table_rows(FOLDER / "first-sightings.md")
    assert f"| 100% | full | {full} |" in levels
    for policy, _, *own in rows:
        for budget, level in zip(budgets, own, strict=True):
            assert re.search(rf"^\| {budget} \| {policy} \| {level} \|", levels, re.M), policy


def test_newcomers_on_recorded_drives_are_those_of_the_rows():
    script = loaded(EXAMPLES / "pooled_drives.py")
    settings = script.read_settings(sorted(DATA.glob("recorded-*-core-first")))
    names = {name.rpartition(":")[2]: name for plays in settings for name in plays.tags}
    (_, *budgets), (_, full, *_), *rows = table_rows(FOLDER / "recorded-drives.md")
    told = {(FULL, 1.0): full} | {
        (names[policy], float(budget.strip("%")) / 100): level
        for policy, *own in rows
        for budget, level in zip(budgets, own, strict=True)
    }
    for (policy, budget), level in told.items():
        tallies = script.pooled(settings, policy, budget)
        assert f"{ratio_level(FIRST_SIGHTING, tallies).by_event:.1f}" == level, policy


def test_collisions_with_and_without_a_camera_are_those_of_the_rows():
    world = ""
    for name, budget, *both, _ in table_rows(FOLDER / "camera.md")[1:6]:
        world = (name or world).partition(",")[0]
        folder = {"drives": "validate-drive", "Euro NCAP": "validate-ncap"}[world]
        rows = read_rows(DATA / folder / EPISODES.file)
        for count, policy in map(str.split, both):
            hits = [
                row["seed"]
                for row in rows
                if row["policy"] == policy
                and row["budget"] == float(budget.strip("%")) / 100
                and row["collision"]
                and split_of([row["seed"]]) == "test"
            ]
            assert len(hits) == int(count), (world, policy)
