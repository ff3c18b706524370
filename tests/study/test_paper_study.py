from collections import Counter

from care_sim.study.designs import crowding, paper


def test_the_study_has_245_episodes_in_the_stated_split():
    configs = paper.paper_study(range(5))
    assert len(configs) == len(set(configs)) == 245
    assert Counter(config.seed for config in configs) == dict.fromkeys(range(5), 49)
    faultless = [c for c in configs if not (c.false_negative_rate or c.camera_latency)]
    assert Counter(c.scenario for c in faultless if c.seed == 0) == {
        "dense": 17,
        "dartout": 13,
        "cutin": 5,
    }
    assert sum(c.false_negative_rate > 0 for c in configs) == 8 * 5
    assert sum(c.camera_latency > 0 for c in configs) == 6 * 5
    assert {c.budget for c in configs if c.policy == "full"} == {1.0}


def test_every_published_result_belongs_to_a_cell_that_is_run():
    cells = {
        (c.scenario, c.policy, c.budget, bool(c.false_negative_rate or c.camera_latency))
        for c in paper.paper_study([0])
    }
    for entry in paper.PUBLISHED_RESULTS:
        assert any(entry.covers(*cell) for cell in cells), entry
    assert paper.published_result("dartout", "history", 0.1, False).detection_m == 11.9
    assert paper.published_result("dartout", "history", 0.03, False) is None


def test_crowding_varies_the_vehicles_from_none_to_all():
    configs = crowding.crowding_study([0])
    assert {dict(c.scenario_parameters)["vehicles"] for c in configs} == set(range(13))
    assert len(configs) == 13 * (2 * 8 + 1)
