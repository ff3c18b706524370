"""The switches of the returns in studies: rows, films and what recordings refuse."""

from functools import partial

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.reports.page.played_rows import config_of
from care_sim.sources.named import source_of
from care_sim.sources.scenes import Streets
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.play_config import PlayConfig

STREETS = Streets()
FOG = {"lidar_stated_range_m": 40.0, "visibility_m": 50.0}
play = partial(PlayConfig, STREETS, STREETS.scenes()[0], "care", budget=0.05)


def test_settings_are_columns_of_rows_where_they_are_switched_on():
    plain = EpisodeConfig("dense", "care")
    foggy = EpisodeConfig("dense", "care", **FOG)
    assert foggy.row() == plain.row() | FOG
    assert config_of(foggy.row()) == foggy
    assert play(**FOG).row() == play().row() | FOG


def test_plays_share_a_film_with_those_of_the_same_returns_alone():
    assert play(lidar_crosstalk=0.1).batch == play(lidar_dropout=0.1).batch == play().batch
    assert play(**FOG).batch != play().batch


def test_recordings_refuse_in_one_line(drive):
    source = source_of(f"argoverse2:{drive.parent}")
    scene = source.scenes()[0]
    with pytest.raises(InvalidInput, match="lidar_sweep_s cannot be changed on recordings"):
        PlayConfig(source, scene, "care", lidar_sweep_s=0.1)
    assert len(PlayConfig(source, scene, "care", lidar_crosstalk=0.1).film().shots) > 1
