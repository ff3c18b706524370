"""The open loop's ablations: every level is played, and is found again by its key."""

from collections import Counter

from care_sim.sources.scenes import Scene, Streets
from care_sim.study.designs.ablations import (
    ABLATIONS,
    OPEN_ABLATIONS,
    ablation_plays,
    ablation_study,
    quarter_of,
)
from care_sim.study.designs.variants import USUAL_VARIANT, FilmPlace
from care_sim.study.rows.reading import key_of

STREETS = Streets("evaluation")
SCENE = Scene("street-0000", 0)
PLACE = FilmPlace("streets", 0.1)


def keys(configs):
    return Counter(key_of(config.row()) for config in configs)


def test_every_level_and_reference_is_one_play_of_a_scene():
    played = keys(ablation_plays(STREETS, [SCENE], [0.1]))
    assert set(played.values()) == {1}
    wanted = {
        level.key(PLACE, ablation.policy)
        for ablation in OPEN_ABLATIONS
        for level in ablation.levels
    } | {
        level.for_others().key(PLACE, policy)
        for ablation in OPEN_ABLATIONS
        for level in ablation.levels
        for policy in ablation.references
    }
    assert set(played) == wanted | {USUAL_VARIANT.key(PLACE, "full")}


def test_further_policies_are_played_where_conditions_vary_and_the_full_scan_once():
    several = ablation_plays(STREETS, [SCENE], [0.1, 0.2], ["random"])
    conditions = {
        tuple((name, value) for name, value in config.row().items() if name not in ("budget",))
        for config in several
        if config.policy == "random"
    }
    # The usual ones, two of rho, two margins, one confidence, one latency, six orders of cells:
    # rows-down by its name is that of a policy which lists its sets otherwise.
    assert len(conditions) == 1 + 2 + 2 + 1 + 1 + 6
    assert sum(config.policy == "full" for config in several) == 1


def test_the_quarter_of_the_streets_holds_every_layout():
    """38 scenes, as many as the paper's. Every fourth street would be straight."""
    quarter = quarter_of(STREETS.scenes())
    assert len(quarter) == 38
    assert [scene.seed for scene in quarter[:5]] == [0, 5, 10, 15, 16]
    layouts = Counter(scene.name.split("-", 2)[2] for scene in quarter)
    assert len(layouts) == 4
    assert min(layouts.values()) >= 9


def test_the_closed_loop_has_the_ablations_that_it_had():
    assert len(ablation_study([0])) == 162
    assert len(ABLATIONS) == 9
