from types import SimpleNamespace

from care_sim.reports.episodes.timeline import eventful


def frame(number, braking):
    return SimpleNamespace(
        index=number, in_view=False, detected=False, braking=braking, impact_speed_mps=None
    )


def test_only_the_keyframes_about_a_change_are_shown():
    frames = [frame(n, braking=n >= 5) for n in range(10)]
    assert [f and f.index for f in eventful(frames)] == [0, None, 4, 5, None, 9]
    assert eventful(frames[:1]) == frames[:1]
