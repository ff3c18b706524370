"""README, site and notebook: their Python runs as it stands, commands are understood, links lead
somewhere.
"""

import json
import os
import re
import shlex
import tomllib
from pathlib import Path

import numpy as np
import pytest
from pyarrow.parquet import read_schema

from care_sim import cli
from care_sim.base.errors import InvalidInput
from care_sim.base.seeds import SPLITS
from care_sim.commands.table import COMMANDS
from care_sim.core.conditions import DEFAULTS
from care_sim.core.types import CLASSES, ImageDetections, Tracks
from care_sim.envs import IDS
from care_sim.sources.street_films import street_film
from care_sim.study.results_formats import RESULTS_FORMATS
from care_sim.training.config import PpoConfig
from care_sim.training.folder import read_table
from care_sim.training.hyperparameters import read_hyperparameters
from tests.helpers.forked import LEARNING, LIBRARIES, Forked
from tests.helpers.places import EXAMPLES, PAGES, README, ROOT, SITE, fenced, links, loaded, name_of

NOTEBOOK = ROOT / "docs" / "quickstart.ipynb"
ENVIRONMENT_PAGES = loaded(ROOT / "docs" / "environment_pages.py")
FURTHER = {
    "RecordVideo": "moviepy",
    "RecordRerun": "rerun",
    "import polars": "polars",
    "from torchrl": "torchrl",
}
"""Names in a block, and the library that each then needs beside the installation."""
STRATUM_SUM = re.compile(r"[^/]+/[^/]+/(delay|events|found|frames|sighted)")
"""KIND/STRATUM/NAME, which a page explains in one line for all strata."""

FIRST_STEPS, FURTHER_STEPS = 4_096, 28_672
"""Together about a minute on one core."""
LEARNED = 15.0
"""Reward per episode. Five seeds gained 25 to 31 in these steps or fewer, Stable-Baselines3's own
settings 3, a learning rate of 0 up to 2.
"""

BLOCKS = [
    pytest.param(block, id=f"{name_of(page)}-{number}")
    for page in PAGES
    # The policy of the README has a test of its own, which plays it.
    if page != README
    for number, block in enumerate(fenced(page, "python"))
]
LINES = [
    (name_of(page), line.partition("#")[0].strip())
    for page in PAGES
    for block in fenced(page, "")
    for line in block.replace("\\\n", " ").splitlines()
    if re.match(r"care-sim [a-z]", line)
]


@pytest.fixture(scope="module")
def forked():
    with Forked((*LIBRARIES, *LEARNING)) as forked:
        yield forked


@pytest.mark.parametrize("block", BLOCKS)
def test_a_block_runs_on_its_own(block, tmp_path, drive, forked):
    """In an empty folder, with an Argoverse 2 log in `logs` and what was published in `results`."""
    for named, library in FURTHER.items():
        if named in block:
            pytest.importorskip(library)
    (tmp_path / "logs").symlink_to(drive.parent)
    (tmp_path / "results").symlink_to(ROOT / "results")
    done = forked.run(block, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def understood(line):
    try:
        cli.parsed_command(shlex.split(line)[1:])
    except InvalidInput:
        return False
    except SystemExit as end:
        return end.code == 0
    return True


def test_commands_are_understood():
    assert len(LINES) > 30
    assert [entry for entry in LINES if not understood(entry[1])] == []


def test_files_that_a_page_names_are_there():
    """Files of the repository, as seen from its root."""
    named = [
        (page, name)
        for page in PAGES
        for name in re.findall(r"`((?:docs|care_sim|examples|tests)/[\w./]*)`", page.read_text())
    ]
    assert len(named) > 5
    assert [(name_of(page), name) for page, name in named if not (ROOT / name).exists()] == []


@pytest.mark.slow
def test_the_learner_of_the_examples_learns():
    """By the rewards of a hundred episodes: between two rollouts the distance that the example
    prints may fall by ten metres.
    """
    pytest.importorskip("stable_baselines3")
    example = loaded(EXAMPLES / "train_ppo.py")
    before, after = example.main(steps=1_024, rate=0.0)
    assert before == after
    model, means = example.make_model(example.RATE), []
    for steps in (FIRST_STEPS, FURTHER_STEPS):
        model.learn(steps, reset_num_timesteps=False)
        means.append(np.mean([episode["r"] for episode in model.ep_info_buffer]))
    assert means[1] > means[0] + LEARNED


@pytest.mark.slow
def test_hyperparameters_are_chosen_in_one_file_that_can_be_run_again(tmp_path):
    for library in ("optuna", "stable_baselines3"):
        pytest.importorskip(library)
    example = loaded(EXAMPLES / "tune_ppo.py")
    for _ in range(2):
        example.main(tmp_path, 1, steps=64, episodes=1)
    assert {path.name for path in tmp_path.iterdir()} >= {"000", "001"}
    best = read_hyperparameters(PpoConfig, [example.ENV], tmp_path / "best.toml")
    assert best.values.keys() == {*example.TRIED}
    returns = [
        max(row["return"] for row in read_table(tmp_path / n / "curve.csv")) for n in ("000", "001")
    ]
    tried = [json.loads((tmp_path / n / "config.json").read_text()) for n in ("000", "001")]
    assert tried[0]["learning_rate"] == PpoConfig.learning_rate
    assert best.values["learning_rate"] == tried[int(np.argmax(returns))]["learning_rate"]


def test_a_detector_runs_on_a_sweep_in_one_file(tmp_path, monkeypatch, capsys):
    pytest.importorskip("torch")
    example = loaded(EXAMPLES / "detect_a_sweep.py")
    film = street_film(2500)
    forward, left, up = film.shots[0].cloud.points.T
    monkeypatch.setattr(example, "HEIGHT_M", film.sensor_height_m)
    rest = np.zeros_like(up)
    rows = np.stack([-left, forward, up, rest, rest], axis=1)
    rows.astype(np.float32).tofile(tmp_path / "sweep.bin")
    example.main(tmp_path / "sweep.bin", tmp_path / "out.png")
    counts = dict(line.split() for line in capsys.readouterr().out.splitlines())
    cars = np.sum(film.shots[0].annotations.classes == CLASSES.index("car"))
    assert 0.5 * cars < int(counts["car"]) < 1.5 * cars
    assert (tmp_path / "out.png").stat().st_size > 10_000


def test_other_ways_through_the_network_of_pillars_answer_alike():
    pytest.importorskip("torch")
    example = loaded(EXAMPLES / "pillars_in_numpy.py")
    told = {name: made[0] for name, (made, _) in example.answers_and_times(1).items()}
    assert np.abs(told["PyTorch"]).max() > 1
    np.testing.assert_allclose(told["NumPy"], told["PyTorch"], atol=1e-4)
    np.testing.assert_allclose(told["numba"], told["PyTorch"], atol=1e-4)


def test_by_the_proxy_the_car_brakes_for_somebody_in_view():
    example = loaded(EXAMPLES / "early_brakes.py")
    assert -1 < example.early_s("CARE-Dartout-v0", "returns", 0) < 0


def test_the_readme_is_read_in_three_minutes():
    prose = re.sub(r"```.*?```", "", README.read_text(), flags=re.S)
    assert len(prose.split()) <= 450


def test_the_policy_of_the_readme_plays_with_its_command(tmp_path, forked):
    (block,) = fenced(README, "python")
    assert len([line for line in block.splitlines() if line.strip()]) <= 10
    (tmp_path / "corridor.py").write_text(block)
    (line,) = (line for page, line in LINES if page == "README.md" and " run " in line)
    played = f"from care_sim import cli\ncli.main({shlex.split(line)[1:]})"
    done = forked.run(played, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "corridor:Corridor" in done.stdout


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    """In a file view too, which does not follow a link to a folder: `docs/results` is one."""
    for target in links(page):
        place = Path(os.path.normpath(page.parent / target))
        assert place.exists(), target
        folders = [folder for folder in place.parents if folder.is_relative_to(ROOT)]
        assert not any(folder.is_symlink() for folder in folders), f"{target} is behind a link"


def test_every_command_has_its_line():
    page = ROOT / "docs" / "commands.md"
    told = [line for block in fenced(page, "") for line in block.splitlines()]
    lacking = {
        name for name in COMMANDS if not any(f"care-sim {name} " in f"{line} " for line in told)
    }
    assert lacking == set()


def test_every_environment_has_a_page():
    text = "".join(page.read_text() for page in SITE if page.parent.name == "environments")
    for entry_point in IDS.values():
        assert f"<!-- from {entry_point.replace(':', '.')} -->\n" in text


def test_the_table_of_agents_says_what_their_cards_say():
    agents_table = loaded(ROOT / "docs" / "agents_table.py")
    # A table that is not as the cards: python docs/agents_table.py
    page = (ROOT / "docs" / "learning.md").read_text()
    assert agents_table.written(page) == page


@pytest.mark.parametrize("page", ENVIRONMENT_PAGES.PAGES, ids=name_of)
def test_a_page_of_environments_is_read_in_a_clone_and_says_what_docstrings_say(page):
    # A text that is not as its docstring: python docs/environment_pages.py
    assert ENVIRONMENT_PAGES.written(page) == page.read_text()


def test_a_page_lists_only_the_arguments_that_another_page_does_not():
    page = (ROOT / "docs" / "environments" / "dense.md").read_text()
    assert re.findall(r"^- `(\w+)=", page, re.M) == ["vehicles", "place_jitter_m"]


def test_one_page_says_which_seeds_are_for_what():
    page = ROOT / "docs" / "seeds.md"
    rows = re.findall(r"^\| `(\w+)` \| ([\d,]+) (?:to ([\d,]+)|and up) \|", page.read_text(), re.M)
    told = {name: [end and int(end.replace(",", "")) for end in ends] for name, *ends in rows}
    ends = {name: [seeds[0], seeds[-1]] for name, seeds in SPLITS.items()}
    assert told == ends | {"train": [SPLITS["train"][0], ""]}
    ranges = re.compile(r"\b(0 to 999|1,?000 to 1,?999|[12],?000 to 9,?999)\b")
    assert [other for other in PAGES if ranges.search(other.read_text())] == [page]


def test_the_columns_of_an_observation_are_explained_in_their_order():
    page = (ROOT / "docs" / "environments" / "common.md").read_text()
    for key, table in (("detections", ImageDetections), ("tracks", Tracks)):
        (columns,) = re.findall(rf"^\| column of `{key}` .*\n\|[-|]+\n((?:\|.*\n)+)", page, re.M)
        told = re.findall(r"`(\w+)`", " ".join(row.split("|")[1] for row in columns.splitlines()))
        assert told == [*table.COLUMNS]


def test_the_notebook_is_kept_without_outputs():
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) > 3
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


def test_the_citation_and_the_notebook_name_this_version():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"care_sim-{version}-py3-none-any.whl" in NOTEBOOK.read_text()


def test_every_column_of_the_results_is_explained():
    files = sorted((ROOT / "results").rglob("*.parquet"))
    assert {name for file in files for name in unexplained(read_schema(file).names)} == set()


def test_every_column_that_is_read_is_explained():
    for kind in RESULTS_FORMATS:
        assert not unexplained({*kind.schema.needed, *kind.schema.further, *DEFAULTS})


def unexplained(names):
    """Names that are neither on the page of columns nor on that of conditions."""
    pages = ROOT / "docs" / "columns.md", ROOT / "docs" / "api" / "conditions.md"
    text = "".join(page.read_text() for page in pages)
    explained = re.findall(r"^(?:- (.*?): |\| (.*?) \|)", text, re.M)
    told = set(re.findall(r"`([\w/ .-]+)`", " ".join(map("".join, explained))))
    unknown = {name for name in names if not {name, re.sub(r"\..*", ".NAME", name)} & told}
    return {name for name in unknown if not STRATUM_SUM.fullmatch(name)}
