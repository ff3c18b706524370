import io

import pytest
from rich.console import Console

from care_sim.study.config import EpisodeConfig, grid
from care_sim.study.figures import study_figures
from care_sim.study.summary import difference, quartiles, setting_of, summarise
from care_sim.study.tables import crowding_table, study_tables


def row(config, distance, **changes):
    outcome = {
        "detection_distance_m": distance,
        "braked": True,
        "min_distance_m": 5.0,
        "clearance_m": 3.0,
        "collision": False,
        "impact_speed_mps": None,
        "rays_fired": 1000,
    }
    return config.row() | outcome | changes


def rows(policy, distances, scenario="dense", budget=0.03, **conditions):
    configs = grid([scenario], [policy], [budget], range(len(distances)), **conditions)
    return [row(config, distance) for config, distance in zip(configs, distances, strict=True)]


STUDY = [
    *rows("history", [4.0, None, 8.0, 6.0, None]),
    *rows("all-camera", [10.0, 11.0, 12.0, 13.0, 14.0]),
    *rows("care", [15.0, 16.0, 17.0, 18.0, 19.0]),
    *rows("full", [15.0, 16.0, 17.0, 18.0, 19.5]),
]


def cell(policy, study=STUDY):
    return next(cell for cell in summarise(study) if cell.policy == policy)


def test_medians_and_quartiles():
    assert cell("care").detection == (quartiles([15.0, 16.0, 17.0, 18.0, 19.0]))
    assert (cell("care").detection.low, cell("care").detection.median, cell("care").detection.high) == (
        16.0,
        17.0,
        18.0,
    )


def test_the_never_detected_count_and_rank_last():
    history = cell("history")
    assert (history.never, history.episodes, history.detection.median, history.detection.low) == (2, 5, 4.0, 0.0)


def test_differences_are_paired_by_seed():
    assert cell("all-camera").vs_care == (-5.0, -5.0, -5.0)
    assert cell("care").vs_full.mean == pytest.approx(-0.1)
    assert cell("care").vs_full.high == 0.0
    shuffled = [*rows("care", [15.0, 16.0])][::-1]
    assert difference(shuffled, rows("full", [15.0, 16.0])) == (0.0, 0.0, 0.0)
    assert difference(rows("care", [1.0]), None) is None


def test_a_fault_is_compared_with_the_full_scan_of_the_faultless_world():
    faulty = rows("care", [14.0] * 5, scenario="dartout", budget=0.1, false_negative_rates=(0.2,))
    study = [*faulty, *rows("full", [15.0] * 5, scenario="dartout")]
    assert cell("care", study).vs_full == (-1.0, -1.0, -1.0)
    assert cell("care", study).setting.label == "dartout, false negative rate 0.2"


def test_other_physics_are_another_setting():
    config = EpisodeConfig("dense", "care", scenario_parameters=(("vehicles", 7),))
    assert setting_of(row(config, 1.0)) != setting_of(row(EpisodeConfig("dense", "care"), 1.0))
    assert study_tables([row(config, 1.0)])[0].title == "dense, vehicles 7"


def test_tables_show_the_papers_figures_beside_ours():
    (table,) = study_tables(STUDY)
    lines = {line[1]: line for line in table.rows}
    assert lines["all-camera"][2] == "12.0 [11.0, 13.0]"
    assert lines["all-camera"][-1] == "10.3"
    assert lines["history"][3] == "2/5"
    assert any("10.3 m" in quote for quote in table.quotes)
    assert "| 3% | history | 4.0 [0.0, 6.0] | 2/5 |" in table.markdown()


def test_the_terminal_shows_every_cell():
    terminal = io.StringIO()
    Console(width=80, file=terminal).print(study_tables(STUDY)[0].rich())
    assert all(
        part in terminal.getvalue() for part in ("all-camera", "12.0 [11.0, 13.0]", "2/5", "15.1", "-5.0 [-5.0, -5.0]")
    )
    assert "…" not in terminal.getvalue()


def test_a_pass_that_was_never_in_view_is_said():
    config = EpisodeConfig("cutin", "care")
    seen, unseen = row(config, 9.0), row(config, None, min_distance_m=None, clearance_m=None)
    assert study_tables([unseen])[0].rows[0][5] == "never in view"
    assert study_tables([seen, unseen | {"seed": 1}])[0].rows[0][5] == "5.0 (of 1)"


CROWD = [
    each
    for vehicles, camera in ((0, 15.0), (5, 14.5), (9, 8.0))
    for policy, distance in (("all-camera", camera), ("care", 15.0), ("full", 15.0))
    for each in rows(policy, [distance] * 2, scenario_parameters=(("vehicles", vehicles),))
]


def test_the_crowding_table_finds_the_collapse():
    table = crowding_table(CROWD)
    assert study_tables(CROWD) == [table]
    assert table.rows[2] == ("9", "15.0", "15.0/8.0 -7.0 [-7.0, -7.0]")
    assert table.notes[-1].endswith("3%: 9.")


@pytest.mark.parametrize(
    ("study", "name"), [(STUDY + rows("care", [15.0] * 5, budget=0.1), "dense-budget"), (CROWD, "crowding")]
)
def test_figures_are_written(study, name, tmp_path):
    from care_sim.study.figures import save

    figures = study_figures(study)
    assert list(figures) == [name]
    save(figures[name], tmp_path / name)
    assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    drawing = (tmp_path / f"{name}.svg").read_text()
    save(study_figures(study)[name], tmp_path / name)
    assert (tmp_path / f"{name}.svg").read_text() == drawing


def test_the_figure_names_its_curves_and_the_never_detected():
    axes = study_figures(STUDY + rows("history", [9.0] * 5, budget=0.1))["dense-budget"].axes[0]
    texts = [text.get_text() for text in axes.texts]
    assert {"history", "care", "all-camera", "full scan", "2 never"} <= set(texts)
