"""How long an episode lasts, and what its seed holds."""

from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.times import LAST_BITS_S
from care_sim.loops.episode import EpisodeSeeds, most_keyframes
from care_sim.world.world import WORLD_STEP_S


@given(st.integers(1, 20), st.integers(5, 6000).map(lambda n: n / 100))
def test_an_episode_ends_with_the_keyframe_that_fills_its_time(steps, duration_s):
    # As an environment goes on: the world counts its steps, and rounds the time.
    played, time_s = 0, 0.0
    while time_s < duration_s - LAST_BITS_S:
        played += 1
        time_s = round(played * steps * WORLD_STEP_S, 9)
    assert most_keyframes(duration_s, steps * WORLD_STEP_S) == played


def test_the_streams_of_an_episode_have_their_places_in_its_seed():
    seeds = EpisodeSeeds.of(7)
    told = [seeds.scenario, *seeds.sensors, seeds.floor, seeds.another]
    assert [one.spawn_key for one in told] == [(0,), (1,), (2,), (4,), (6,), (3,), (5,)]
    assert {one.entropy for one in told} == {(7,)}
    assert EpisodeSeeds.of(7, "a secret of sixteen bytes").floor.entropy != (7,)
