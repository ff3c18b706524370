"""Another sensor set-up in studies: its name and hash in rows, digests and tables."""

import json

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.core.sensor_setup import SensorSetup
from care_sim.reports.page.played_rows import config_of
from care_sim.reports.page.replay import replayed
from care_sim.sensors.setups import sensor_setup
from care_sim.sources.named import source_of
from care_sim.sources.scenes import Streets
from care_sim.study.episode_config import EpisodeConfig, listed_episodes
from care_sim.study.episode_play import trace
from care_sim.study.play_config import PlayConfig, listed_plays
from care_sim.study.rows.parquet import read_rows, write_rows
from care_sim.study.rows.reading import setting_of

FILE = """
name = "mine"

[lidar]
columns = 90
rows = 8
top_deg = 3.0
bottom_deg = -9.0
"""
SCENE = Streets().scenes()[0]


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(FILE)
    return path


def episode(**given):
    return EpisodeConfig("dense", "care", **given)


def play(sensor="hdl-32e"):
    return PlayConfig(Streets(sensor=sensor), SCENE, "care")


@pytest.mark.parametrize("config", [episode, play])
def test_rows_carry_the_name_and_the_hash_of_what_a_file_holds(config, file):
    mine = config(sensor=str(file))
    row = mine.row()
    assert (row["sensor"], row["sensor_hash"]) == ("mine", sensor_setup(file).digest)
    assert SensorSetup.from_json(row["sensor_setup"]) == sensor_setup(file)
    # Rows of the default are as they were before there was a choice.
    assert not [name for name in config().row() if "sensor" in name]
    assert config(sensor="hdl-32e").digest() == config().digest()
    assert "sensor=mine" in mine.label
    before = mine.digest()
    assert before != config().digest()
    file.write_text(FILE.replace("3.0", "2.0"))
    assert mine.digest() != before


@pytest.mark.parametrize("config", [episode, play])
def test_tables_keep_set_ups_of_one_name_apart(config, file):
    usual = setting_of(config().row())
    one = setting_of(config(sensor=str(file)).row())
    file.write_text(FILE.replace("3.0", "2.0"))
    other = setting_of(config(sensor=str(file)).row())
    assert len({usual, one, other}) == 3
    assert "sensor mine" in one.label
    assert one.for_full() == one


@pytest.mark.parametrize("config", [episode, play])
def test_a_set_up_is_named_by_its_file_or_given_as_it_is(config, file):
    named, given = config(sensor=str(file)), config(sensor=sensor_setup(file))
    assert given.row() == named.row()
    assert given.digest() == named.digest()
    assert given.label == named.label
    assert "columns" not in given.label
    json.dumps(listed_episodes([given]) if config is episode else listed_plays([given]))


def test_an_episode_of_a_page_is_played_again_without_the_file_of_its_set_up(file, tmp_path):
    config = episode(sensor=str(file), budget=0.2, seed=3)
    row, _ = trace(config)
    file.unlink()
    write_rows([row], tmp_path / "episodes.parquet")
    (read,) = read_rows(tmp_path / "episodes.parquet")
    again = replayed(config_of(read))
    assert again.row["episode_hash"] == row["episode_hash"]
    assert again.story["ego"]["reach"] == 5000


def test_what_has_no_sensor_to_choose_is_refused_in_one_line(tmp_path):
    with pytest.raises(InvalidInput, match="sensor has no meaning for argoverse2 recordings"):
        source_of(f"argoverse2:{tmp_path}", sensor="os1-64")
    with pytest.raises(InvalidInput, match="unknown sensor 'os2'"):
        source_of("streets", sensor="os2")
    with pytest.raises(InvalidInput, match="unknown sensor 'os2'"):
        episode(sensor="os2")
    with pytest.raises(InvalidInput, match=r"grid is columns 512 .*needed is"):
        EpisodeConfig("dense", "ppo", sensor="os1-64").try_out()
