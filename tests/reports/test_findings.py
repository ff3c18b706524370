"""What a study showed, in words."""

from care_sim.policies import tags_of
from care_sim.reports.findings import protocol_findings, sweep_findings
from care_sim.study.episode_config import EpisodeConfig
from tests.helpers import made_plays
from tests.helpers.made_rows import row

SEEDS = range(6)


def episodes(distances, scenario="dense", budget=0.03, **more):
    """Rows of every seed by policy: a distance, or one a seed."""
    return [
        row(
            EpisodeConfig(scenario, policy, 1.0 if policy == "full" else budget, seed),
            given[seed] if isinstance(given, tuple) else given,
            tags="+".join(tags_of(policy)),
            **more.get(policy, {}),
        )
        for policy, given in distances.items()
        for seed in SEEDS
    ]


def test_the_first_of_the_policies_stands_beside_the_best_control():
    rows = episodes({"care": 16.0, "history": 8.0, "fan": 12.0, "rows": 11.0, "full": 17.0})
    first, hindsight = sweep_findings(rows)
    assert first == (
        "dense, 3%: care detects farthest, 16.0 m on average, ahead of every other policy; it "
        "beats the best control, fan (+4.0* [4.0,4.0] m)."
    )
    assert "by the very results" in hindsight


def test_a_tie_and_a_control_that_is_ahead_are_told():
    wavering = (15.0, 17.0, 16.0, 16.0, 15.5, 16.5)
    tied, _ = sweep_findings(episodes({"care": 16.0, "history": wavering, "fan": 16.0}))
    assert "; history cannot be told from it" in tied
    assert "it cannot be told from the best control, fan (+0.0 [0.0,0.0] m)" in tied
    beaten, _ = sweep_findings(episodes({"care": 10.0, "fan": 16.0}))
    assert "it is beaten by the best control, fan (-6.0* [-6.0,-6.0] m)" in beaten


def test_what_no_car_can_have_leads_nothing_and_one_alone_is_no_contest():
    rows = episodes({"history-oracle": 20.0, "care": 16.0, "history": 8.0})
    first, _ = sweep_findings(rows)
    assert first.startswith("dense, 3%: care detects farthest")
    assert sweep_findings(episodes({"history-oracle": 20.0, "care": 16.0, "full": 17.0})) == []
    assert sweep_findings(episodes({"fan": 16.0, "rows": 15.0, "full": 17.0})) == []


def test_a_seed_that_a_policy_lacks_counts_for_nobody():
    rows = episodes({"care": (2.0, 16.0, 16.0, 16.0, 16.0, 16.0), "history": 15.0})
    # Care is behind by the mean of all seeds, and ahead on those that both have.
    without = [one for one in rows if (one["policy"], one["seed"]) != ("history", 0)]
    assert sweep_findings(without)[0].startswith("dense, 3%: care detects farthest")
    assert sweep_findings(rows)[0].startswith("dense, 3%: history detects farthest")


def test_collisions_that_a_full_scan_prevents_are_told():
    hit = {"history": {"collision": True}}
    rows = episodes({"care": 16.0, "history": 8.0, "full": 17.0}, **hit)
    _, collisions, _ = sweep_findings(rows)
    assert collisions == (
        "dense, 3%: care collides least, in 0 of 6 episodes, ahead of every other policy."
    )
    doomed = episodes({"care": 16.0, "history": 8.0, "full": 17.0}, **hit, full={"collision": True})
    assert not any("collides" in sentence for sentence in sweep_findings(doomed))


def test_the_open_loop_tells_who_finds_most_at_once():
    plays = made_plays.study(
        {"care": (12, 6), "history": (4, 6), "rows": (9, 6), "full": (15, 9)},
        seeds=(0,),
        budgets=(0.1,),
    )
    first, _ = protocol_findings(plays)
    assert first.startswith(
        "generated streets, detector returns, 10%: care finds most first sightings at once, 60.0%, "
        "ahead of every other policy; it beats the best control, rows (+15.0 ["
    )
