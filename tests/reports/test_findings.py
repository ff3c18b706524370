"""What a study showed, in words."""

from care_sim.policies import tags_of
from care_sim.reports.findings.closed_loop import sweep_findings
from care_sim.reports.findings.open_loop import protocol_findings
from care_sim.study.episode_config import EpisodeConfig
from tests.helpers import made_plays
from tests.helpers.made_rows import row

SEEDS = range(6)
WAVERING = (15.0, 17.0, 16.0, 16.0, 15.5, 16.5)


def episodes(distances, seeds=SEEDS, **more):
    """Rows of every seed by policy: a distance, or one a seed; None is never."""
    return [
        row(
            EpisodeConfig("dense", policy, 1.0 if policy == "full" else 0.03, seed),
            given[seed] if isinstance(given, tuple) else given,
            tags="+".join(tags_of(policy)),
            **more.get(policy, {}),
        )
        for policy, given in distances.items()
        for seed in seeds
    ]


def told(distances, **more):
    """The first sentence."""
    return sweep_findings(episodes(distances, **more))[0]


def test_the_first_stands_beside_the_best_control():
    rows = episodes({"care": 16.0, "history": 8.0, "fan": 12.0, "rows": 11.0, "full": 17.0})
    first, played, hindsight = sweep_findings(rows)
    assert first == (
        "dense, 3%: care detects farthest, 16.0 m on average over 6 episodes, the full scan "
        "17.0 m; care is ahead of the best control, fan (+4.0* [4.0,4.0] m)."
    )
    assert played == "Compared are the 4 policies played here."
    assert "by the very results" in hindsight


def test_a_control_that_is_ahead_leads():
    assert told({"care": 10.0, "history": 8.0, "fan": 16.0}) == (
        "dense, 3%: fan detects farthest, 16.0 m on average over 6 episodes; the best control, "
        "fan, is ahead of care (-6.0* [-6.0,-6.0] m)."
    )


def test_ties_are_no_lead():
    assert told({"care": 16.0, "history": 8.0, "fan": 16.0}) == (
        "dense, 3%: care and fan detect farthest, 16.0 m on average over 6 episodes; the best "
        "control, fan, does exactly as well as care."
    )
    assert told({"care": 16.0, "history": 16.0, "fan": 16.0}) == (
        "dense, 3%: all 3 policies detect equally far, 16.0 m on average over 6 episodes, controls "
        "included."
    )
    assert told({"care": 16.1, "history": WAVERING, "random": 3.0}) == (
        "dense, 3%: care detects farthest, 16.1 m on average over 6 episodes, ahead of random "
        "(+13.1* [13.1,13.1] m); history cannot be told from it."
    )
    assert "care and the best control, fan, cannot be told apart (+0.1 [-0.4,0.6] m)" in told(
        {"care": 16.1, "fan": WAVERING}
    )


def test_a_difference_below_the_gate_is_called_so():
    assert (
        "ahead of the best control, fan, by less than the gate of 2.5 m (+1.0 [1.0,1.0] m)"
        in told({"care": 16.0, "fan": 15.0})
    )


def test_who_is_behind_by_less_than_the_gate_is_told():
    assert told({"care": 16.0, "care-spread": 15.0, "all-camera": 14.0, "history": 8.0}) == (
        "dense, 3%: care detects farthest, 16.0 m on average over 6 episodes, ahead of history "
        "(+8.0* [8.0,8.0] m); care-spread and all-camera are behind by less than the gate of "
        "2.5 m."
    )


def test_the_full_scan_is_told_over_the_same_episodes_or_not_at_all():
    rows = episodes({"care": 16.0, "history": 8.0})
    never = episodes({"full": (17.0, 17.0, 17.0, 17.0, 17.0, None)})
    assert ", the full scan at most 14.7 m, ahead" in sweep_findings([*rows, *never])[0]
    assert "the full scan" not in sweep_findings([*rows, *never[:5]])[0]


def test_that_no_control_was_played_is_told():
    rows = episodes({"history-oracle": 20.0, "care": 16.0, "history": 8.0, "full": 17.0})
    assert (
        "Compared are the 2 policies played here, no control among them: name fan or place, too."
        in sweep_findings(rows)
    )


def test_what_no_car_can_have_is_in_no_contest_and_one_alone_is_none():
    assert told({"history-oracle": 20.0, "care": 16.0, "history": 8.0}) == (
        "dense, 3%: care detects farthest, 16.0 m on average over 6 episodes, ahead of history "
        "(+8.0* [8.0,8.0] m)."
    )
    assert sweep_findings(episodes({"history-oracle": 20.0, "care": 16.0, "full": 17.0})) == []
    assert sweep_findings(episodes({"fan": 16.0, "rows": 15.0, "full": 17.0})) == []
    few = sweep_findings(episodes({"care": 16.0, "history": 8.0}, seeds=range(4)))
    assert len(few) == 1
    assert few[0].startswith("Who leads is told of 5 seeds and more that all policies share")
    for nobody in ({"care": 16.0, "full": 18.0}, {"fan": 16.0, "rows": 15.0}):
        assert sweep_findings(episodes(nobody, seeds=range(4))) == []
    # Six seeds of each, of which four are shared.
    rows = [
        *episodes({"care": 16.0}, seeds=range(6)),
        *episodes({"history": 8.0}, seeds=range(2, 8)),
    ]
    assert sweep_findings(rows) == few


def test_a_seed_that_a_policy_lacks_counts_for_nobody():
    rows = episodes({"care": (2.0, 16.0, 16.0, 16.0, 16.0, 16.0), "history": 15.0})
    # Care is behind by the mean of all seeds, and ahead on those that both have.
    without = [one for one in rows if (one["policy"], one["seed"]) != ("history", 0)]
    assert sweep_findings(without)[0].startswith(
        "dense, 3%: care detects farthest, 16.0 m on average over 5 episodes"
    )
    assert sweep_findings(rows)[0].startswith(
        "dense, 3%: history detects farthest, 15.0 m on average over 6 episodes"
    )


def test_who_is_never_detected_is_told_and_nobody_leads_where_all_are():
    sometimes = (16.0, 16.0, 16.0, 16.0, 16.0, None)
    assert "care detects farthest, at most 13.8 m on average over 6 episodes (1 never)" in told(
        {"care": sometimes, "history": 4.0}
    )
    assert sweep_findings(episodes({"care": None, "history": None})) == []
    # Who missed the same actor has not been shown to be as good.
    assert "exactly" not in told({"care": sometimes, "fan": sometimes, "history": 4.0})


def test_collisions_that_a_full_scan_prevents_are_told():
    hit = {"history": {"collision": True}}
    rows = episodes({"care": 16.0, "history": 8.0, "full": 17.0}, **hit)
    _, collisions, *_ = sweep_findings(rows)
    assert collisions == (
        "dense, 3%: care collides least, in 0 of 6 episodes that the full scan ends unhurt, "
        "ahead of history (+100* [100,100] points)."
    )
    without = [one for one in rows if one["policy"] != "full"]
    assert sweep_findings(without)[1].startswith(
        "dense, 3%: care collides least, in 0 of 6 episodes, ahead of history"
    )
    doomed = episodes({"care": 16.0, "history": 8.0, "full": 17.0}, **hit, full={"collision": True})
    assert not any("collide" in sentence for sentence in sweep_findings(doomed))


def test_over_several_budgets_the_best_is_held_against_the_best_control_first():
    found = {
        0.01: (16.0, 15.0),
        0.03: (16.0, 12.0),
        0.05: (16.0, 20.0),
        0.1: (16.0, 16.0),
        0.2: (16.1, WAVERING),
    }
    rows = [
        one | {"budget": budget}
        for budget, (care, place) in found.items()
        for one in episodes({"care": care, "history": 8.0, "place": place})
    ]
    first, second, *_, hindsight = sweep_findings(rows)
    assert first == (
        "dense, first detections: compared with the best control of each budget (place), the best "
        "other policy (care): ahead at 3%; ahead, not shown to reach the gate of 2.5 m, at 1%; "
        "the same in every world at 10%; not to be told apart at 20%; behind at 5%."
    )
    assert hindsight.startswith("Who is first, the best control, and the best other policy are")
    assert second.startswith("dense, 1%: care detects farthest")
    without = [one for one in rows if one["policy"] != "place"]
    assert sweep_findings(without)[0].startswith("dense, 1%: care detects farthest")


def test_a_bound_on_a_lead_reaches_the_gate_only_where_the_worst_case_does():
    def rows(care, place):
        return [
            one | {"budget": budget}
            for budget in (0.03, 0.1)
            for one in episodes({"care": care, "place": place}, seeds=range(30))
        ]

    missed = (None, *(16.0,) * 29)
    short, far = sweep_findings(rows(missed, 14.0)), sweep_findings(rows(missed, 4.0))
    assert "is ahead of the best control, place (≤+1.6 [0.7,2.0] m)" in short[1]
    assert ": ahead, not shown to reach the gate of 2.5 m, at 3%, 10%." in short[0]
    assert ": ahead at 3%, 10%." in far[0]


def test_the_open_loop_tells_who_finds_most_at_once():
    plays = made_plays.study(
        {"care": (12, 6), "history": (4, 6), "rows": (9, 6), "full": (15, 9)},
        seeds=(0,),
        budgets=(0.1,),
    )
    first, *_ = protocol_findings(plays)
    assert first.startswith(
        "generated streets, detector returns, 10%: care finds most first sightings at once, 60.0%, "
        "the full scan 75.0%; care is ahead of the best control, rows (+15.0 ["
    )
