"""The published plays of B90: a map is tuned on all drives but its own."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from care_sim.core.conditions import RAYS
from care_sim.sources.scenes import Scene, Streets
from care_sim.study.benchmark.budgets import MAIN_DETECTOR, play_budgets
from care_sim.study.benchmark.play import player_in
from care_sim.study.benchmark.recorded import RECORDED, RecordedDrive
from care_sim.training.supervised.tuned_place import frames_of, write_map
from tests.helpers.places import ROOT, loaded
from tests.helpers.short_streets import few_and_short


def test_no_map_is_tuned_on_the_drive_that_it_plays(tmp_path):
    script = loaded(ROOT / "docs" / "b90_results.py")
    drives = [RecordedDrive(Streets(), Scene(f"street-{seed:04d}", seed)) for seed in (0, 1)]
    with few_and_short(4), player_in(tmp_path, 1, ThreadPoolExecutor) as player:
        (told,) = script.play_tuned(drives, player, tmp_path)
        for own, other, row in zip(drives, drives[::-1], told.rows, strict=True):
            path = tmp_path / "map.npz"
            write_map(path, frames_of(other.source.film(other.scene, RAYS)), data="the other")
            entry = replace(script.TUNED, parameters=(("path", str(path)),))
            (due,) = play_budgets([entry], player, MAIN_DETECTOR, {RECORDED: [own]})
            assert due.rows == (row,)
    assert told.entry == script.TUNED
    assert str(tmp_path) not in str(told.content())
