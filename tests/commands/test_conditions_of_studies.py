"""`care-sim study ncap` and `care-sim study faults` under conditions."""

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.cli import main
from care_sim.commands.options.further_studies import Ncap
from care_sim.core.conditions import DEFAULTS
from care_sim.reports.studies import STUDIES
from care_sim.study.designs.faults import fault_study
from care_sim.study.rows.parquet import read_rows
from tests.helpers.made_rows import row

LATE = {"camera_profile": "yolox", "lidar_sweep_s": 0.1}


def test_tests_of_euro_ncap_are_played_and_told_under_conditions(tmp_path, capsys):
    asked = "study ncap --tests CPTAns-50 --seeds 1 --budgets 0.1 --policies care full --workers 1"
    with pytest.raises(SystemExit) as end:
        main([*asked.split(), "--camera-profile", "yolox", "--out", f"{tmp_path}"])
    assert end.value.code == 0
    told = capsys.readouterr().out
    assert "Conditions of all episodes: camera profile yolox." in told
    profiles = {
        one["policy"]: one["camera_profile"] for one in read_rows(tmp_path / "episodes.parquet")
    }
    assert profiles == {"care": "yolox", "full": None}


def test_without_conditions_nothing_is_said_of_them():
    rows = [row(config, 9.0) for config in fault_study([0])]
    assert STUDIES["faults"].closing(rows) == [f"Collisions: 0 in {len(rows)} episodes."]
    assert Ncap().sensing().items() >= DEFAULTS.items()


def test_faults_under_conditions_have_the_same_tables_and_say_which():
    def tables(**common):
        rows = [row(config, 10.0 + len(config.policy)) for config in fault_study([0], **common)]
        return STUDIES["faults"].tables(rows), STUDIES["faults"].closing(rows)[1:]

    plain, nothing = tables()
    under, said = tables(**LATE)
    assert under == plain
    assert nothing == []
    assert said == ["Conditions of all episodes: camera profile yolox, lidar sweep s 0.1."]


def test_a_fault_is_no_condition_of_the_study_of_faults():
    with pytest.raises(InvalidInput, match="lidar_dropout is a fault that grows"):
        fault_study([0], lidar_dropout=0.1)
    # What the study starts from anyway may be said.
    assert fault_study([0], lidar_dropout=0.0) == fault_study([0])
