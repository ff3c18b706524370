"""The timed compute path of a keyframe."""

import tracemalloc
from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np
import pytest

from care_sim.core.actions import scores_of
from care_sim.core.allocation import allocate
from care_sim.core.random_floor import RandomFloor
from care_sim.envs.sensing import sensing
from care_sim.measure.bench.choices import TRACKS, observation
from care_sim.measure.compute_path import path, report
from care_sim.measure.compute_path.path import CHOICE, DETECTOR, SCAN, STAGES, compute_path
from care_sim.policies import make_policy
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_setup

MOST_BYTES_A_CELL = 30
"""Held at once are the floor, 8 bytes a cell, the scores of an action, 4, a flag, 1, and the lists
of the cells that are demanded and fired. A table with one flag per cell and track would be 40.
"""


def test_every_stage_of_every_keyframe_is_timed_and_the_detector_at_some():
    spent = compute_path(DEFAULT_SETUP, "care", 0.1, frames=5, seed=0, detect_every=5)
    assert set(spent) == {*STAGES, SCAN}
    assert all(len(ms) == 5 for ms in spent.values())
    # The first keyframe that counts has it, however many come.
    assert np.isfinite(compute_path(DEFAULT_SETUP, "care", 0.1, 1, 0, 10)[DETECTOR]).all()
    assert np.isfinite(spent[DETECTOR]).tolist() == [True, False, False, False, False]
    assert all((spent[stage] > 0).all() for stage in (*STAGES, SCAN) if stage != DETECTOR)
    assert not np.isfinite(compute_path(DEFAULT_SETUP, "care", 0.1, 1, 0)[DETECTOR]).any()


def test_the_policy_meets_as_many_tracks_as_are_told(monkeypatch):
    """With velocities, at every keyframe that counts."""
    met = []

    class Watched:
        def __init__(self, policy):
            self._policy = policy

        def __getattr__(self, name):
            return getattr(self._policy, name)

        def demand(self, belief):
            met.append((len(belief.tracks), int(belief.tracks.hits.min(initial=99))))
            return self._policy.demand(belief)

    made = path.make_policy
    monkeypatch.setattr(path, "make_policy", lambda *given: Watched(made(*given)))
    compute_path(DEFAULT_SETUP, "care", 0.1, frames=10, seed=0)
    assert all(tracks == TRACKS and hits > 1 for tracks, hits in met[5:])
    assert len(met) == 15


def test_figures_leave_out_what_was_not_run_and_add_up_what_was():
    spent = {stage: np.array([1.0, 2.0]) for stage in (*STAGES, SCAN)}
    spent[DETECTOR] = np.array([10.0, np.nan])
    figures = report._figures(spent)
    assert figures[DETECTOR] == [10.0, 10.0, 10.0]
    assert figures["choice"] == pytest.approx([4.5, 5.97, 6.0])
    # Of the whole, only the keyframe at which the detector ran.
    assert figures[report.WHOLE] == pytest.approx([16.0] * 3)
    without = spent | {DETECTOR: np.full(2, np.nan)}
    assert {DETECTOR, report.WHOLE}.isdisjoint(report._figures(without))


def test_the_tables_stand_beside_the_papers_budget():
    spent = {stage: np.array([1.0, 2.0]) for stage in (*STAGES, SCAN)}
    slow = {stage: 3 * ms for stage, ms in spent.items()}
    figures = dict.fromkeys(report.POLICIES, report._figures(spent))
    slower = dict.fromkeys(report.POLICIES, report._figures(slow))
    made = {
        "frames": 2,
        "machine": {"processor": "a processor"},
        "sensors": {"small": figures, "large": slower},
    }
    stages, choice = report.compute_tables(made)
    assert stages.columns == ("stage", "small", "large")
    assert [line[0] for line in stages.rows[: len(STAGES)]] == [*STAGES]
    assert stages.rows[-1] == ("(paper), its perception path", "97.9 of 100 at p99", "")
    assert stages.rows[0][1:] == ("1.50 / 1.99 / 2.00", "4.50 / 5.97 / 6.00")
    assert choice.rows[-1] == ("scan, times the first", "1.0", "3.0")
    assert len(choice.rows) == len(report.POLICIES) + 1
    assert len(CHOICE) == 3


@pytest.mark.parametrize("policy", report.POLICIES)
def test_a_choice_makes_no_table_of_cells_by_tracks(policy):
    """In NumPy; compiled code's own arrays are as long as its sets of cells."""
    finest = sensor_setup("os1-128")
    sensor = replace(finest, grid=replace(finest.grid, columns=2048))
    with gymnasium.make("care_sim:CARE-Dense-v0", sensor=sensor, disable_env_checker=True) as env:
        rig = sensing(env).rig
        asked = make_policy(policy, env)
    asked.reset()
    floors = RandomFloor(np.random.SeedSequence(0), 0, rig.grid.size)
    seen = [observation(rig, number) for number in range(2)]

    def choose(number):
        belief = rig.read(seen[number])
        asked.remember(belief)
        cells = allocate(asked.demand(belief), rig.budget, rig.reserve_fraction)
        scores = scores_of(cells, rig.grid.shape)
        floor = partial(floors.at, number)
        return rig.hardware.fire(scores, rig.budget, floor, np.empty(0, np.int64))

    # The first choice fills tables that are kept.
    choose(0)
    tracemalloc.start()
    fired = choose(1)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(fired) == rig.budget
    assert peak < MOST_BYTES_A_CELL * rig.grid.size
