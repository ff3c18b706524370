"""How many tasks a study may have is checked before any is made."""

import resource
import subprocess
import sys

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.sources.named import source_of
from care_sim.study import episode_config as config
from care_sim.study.designs.ablations import ablation_study
from care_sim.study.designs.crowding import crowding_study
from care_sim.study.designs.faults import fault_study
from care_sim.study.designs.paper import paper_study
from care_sim.study.designs.standards import r157_study
from care_sim.study.episode_config import grid, of_seeds
from care_sim.study.play_config import play_grid

COMMANDS = (
    "reproduce --seeds 1000000000",
    "sweep --seeds 1000000000",
    "sweep --seeds 99999999999999999999",
    "sweep --seeds 1000 --scenarios all --policies all",
    "study ablate --seeds 1000000000",
    "study ablate --seeds 1000",
    "study faults --seeds 1000",
    "study crowding --seeds 1000",
    "study r157 --seeds 1000",
    "protocol --floor-seeds 1000000000",
    "protocol --floor-seeds 5000 --policies care --budgets 0.1",
)
STUDIES = (paper_study, ablation_study, crowding_study, fault_study, r157_study)
ALL_IN_ONE = """
import sys
from care_sim.cli import main
for command in sys.argv[2:]:
    try:
        main([*command.split(), "--out", sys.argv[1]])
    except SystemExit as end:
        print(end.code)
"""


def limited():
    resource.setrlimit(resource.RLIMIT_DATA, (2_000_000_000, 2_000_000_000))


def test_no_study_is_built_that_no_memory_holds(tmp_path):
    command = [sys.executable, "-c", ALL_IN_ONE, str(tmp_path / "out"), *COMMANDS]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=100, preexec_fn=limited, check=True
    )
    assert done.stdout.split() == ["2"] * len(COMMANDS)
    lines = done.stderr.splitlines()
    assert len(lines) == len(COMMANDS)
    assert all("100,000" in line or "seeds must be" in line for line in lines), lines
    assert not (tmp_path / "out").exists()


def test_axes_are_counted_before_they_are_multiplied(monkeypatch):
    many = [n / 1e6 for n in range(1, 20_000)]
    with pytest.raises(InvalidInput, match="at most 100,000"):
        grid(["dartout"], ["care"] * 1000, many, range(1000), many, range(1000))
    source = source_of("streets")
    with pytest.raises(InvalidInput, match="at most 100,000"):
        play_grid(source, source.scenes(), ["care"] * 1000, many, range(1000), range(1000))
    monkeypatch.setattr("care_sim.study.run_config.MOST_TASKS", 12)
    assert len(grid(["dartout"], ["care", "full"], [0.1, 0.2], range(4))) == 12
    with pytest.raises(InvalidInput, match="at most 12, got 15"):
        grid(["dartout"], ["care", "full"], [0.1, 0.2], range(5))


@pytest.mark.parametrize("study", STUDIES)
def test_a_study_of_several_seeds_is_that_of_one_with_each(study, monkeypatch):
    monkeypatch.setattr(config.EpisodeConfig, "__post_init__", lambda self: None)
    whole = study((3, 1, 4), ["random"])
    assert of_seeds(study((3,), ["random"]), (3, 1, 4)) == whole
