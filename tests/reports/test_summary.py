"""The table that ends a study, of rows whose answers are known."""

from care_sim.policies import tags_of
from care_sim.reports.summary import medians, recalls
from care_sim.study.episode_config import EpisodeConfig
from tests.helpers import made_plays
from tests.helpers.made_rows import row


def episodes(distances, **conditions):
    """Rows of every seed by policy, at 3%."""
    return [
        row(
            EpisodeConfig("dense", policy, 1.0 if policy == "full" else 0.03, seed, **conditions),
            found,
            tags="+".join(tags_of(policy)),
        )
        for policy, own in distances.items()
        for seed, found in own.items()
    ]


PLAIN = episodes({
    "history": {0: 4.0, 1: 5.0, 2: 6.0}, "care": {0: 15.0, 1: 16.0, 2: 17.0},
    "care-sbf": {0: 15.0}, "random": {0: 9.0}, "full": {0: 18.0},
    # On the two seeds that both have, `rows` is ahead. The fan lacks the late one.
    "fan": {0: 11.0, 1: 12.0}, "rows": {0: 12.0, 1: 13.0, 2: None},
})  # fmt: skip


def test_medians_of_main_and_further_policies_and_of_the_best_control():
    late = episodes({"care": {0: 9.0}}, camera_latency=2)
    for rows in (PLAIN, [*late, *PLAIN]):
        table = medians(rows)
        assert table.columns == (
            "scenario", "budget", "history", "care", "random", "best control", "full",
        )  # fmt: skip
        assert table.rows == (("dense", "3%", "5.0", "16.0", "9.0", "12.0 rows", "18.0"),)
    # Without a plain setting those with conditions are shown.
    (line,) = medians(late).rows
    assert line[1:] == ("3%", "9.0", "-")


def test_recalls_of_the_open_loop():
    plays = made_plays.study(
        {"care": (12, 6), "history": (4, 6), "rows": (9, 6), "full": (15, 9)},
        seeds=(0,),
        budgets=(0.1,),
    )
    table = recalls(plays)
    assert table.columns[2:] == ("history", "care", "best control", "full")
    assert table.rows[0][1:] == ("10%", "20.0", "60.0", "45.0 rows", "75.0")


def test_a_control_that_lacks_hard_scenes_is_not_the_best():
    """Place finds 10 of 20 events in the two scenes that it has, rows 12 there and none beyond."""
    plays = made_plays.study({"place": (10, 5), "rows": (12, 5)}, seeds=(0,), budgets=(0.1,))
    easy = ("scene 000", "scene 001")
    kept = [each for each in plays if each["policy"] == "rows" or each["scene"] in easy]
    for each in kept:
        if each["policy"] == "rows" and each["scene"] not in easy:
            each |= {"sighted": 0.0}
    assert recalls(kept).rows[0][-2] == "20.0 rows"
