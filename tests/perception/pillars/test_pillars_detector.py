"""The detector around a network: what it takes, what it gives, what it refuses."""

import numpy as np
import pytest

from care_sim.base.array_files import write_arrays
from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.core.cells.boxes import planar_ranges
from care_sim.perception.detectors import make_detector
from care_sim.perception.matching import found_objects
from care_sim.perception.pillars import detector as pillars
from care_sim.perception.pillars.detector import PillarsDetector
from care_sim.perception.pillars.network import (
    LAYERS,
    PILLARS,
    Fixed,
    answers,
    on_plan,
    place_planes,
)
from care_sim.perception.points_only import PointsOnly, checked
from care_sim.sources.street_films import street_film
from tests.helpers.made_points import HEIGHT, road, shell
from tests.helpers.untrained import drawn_arrays, drawn_weights

torch = pytest.importorskip("torch")
POINTS = np.concatenate([shell(8, 6, 0.4, 4.61, 1.95, 1.72), road()])


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return drawn_weights(tmp_path_factory.mktemp("weights") / "drawn.npz")


def test_it_is_made_by_name_and_reports_what_the_contract_allows(file):
    made = make_detector("pillars", HEIGHT, file=file, least_score=0.0)
    assert isinstance(made, PointsOnly)
    found = PillarsDetector(file, least_score=0.0).detect(POINTS, HEIGHT)
    assert 0 < len(checked("pillars", found, len(POINTS))) <= 300
    assert (np.diff(found.scores) <= 0).all()
    assert len(PillarsDetector(file, least_score=1.0).detect(POINTS, HEIGHT)) == 0


def test_a_scan_without_returns_is_no_error(file):
    found = PillarsDetector(file, least_score=0.0).detect(np.empty((0, 3)), HEIGHT)
    assert not found.returns.any()


def test_the_order_of_the_points_does_not_matter_but_for_last_bits(file):
    detector = PillarsDetector(file)
    shuffled = np.random.default_rng(0).permutation(POINTS)
    one, other = (detector.answer(points, HEIGHT) for points in (POINTS, shuffled))
    assert np.allclose(one, other, atol=1e-4)


def test_of_a_pillar_its_mean_point_counts_and_how_many_they_are(tmp_path):
    """Without what is told of the number, a scan whose points all come twice is no other."""
    arrays = drawn_arrays()
    twice = np.repeat(POINTS, 2, axis=0)
    answers_to = {}
    for told in (True, False):
        arrays["near0.weight"][:, LAYERS["point1"].outputs] *= told
        pillars.save_detector(tmp_path / "told.npz", arrays, {})
        detector = PillarsDetector(tmp_path / "told.npz")
        answers_to[told] = [detector.answer(points, HEIGHT) for points in (POINTS, twice)]
    assert np.allclose(*answers_to[False], atol=1e-4)
    assert not np.allclose(*answers_to[True], atol=1e-2)


def test_only_the_height_above_the_road_and_the_sensor_enter_not_the_points_off_the_plan(file):
    detector = PillarsDetector(file)
    far = np.concatenate([POINTS, [[70.0, 0, 0], [10, 10, 9], [0.5, 0.5, -0.2]]])
    assert np.array_equal(detector.answer(POINTS, HEIGHT), detector.answer(far, HEIGHT))
    assert not np.array_equal(detector.answer(POINTS, HEIGHT), detector.answer(POINTS, HEIGHT + 1))


def test_scans_of_a_batch_do_not_see_each_other():
    network, places = Fixed(torch, drawn_arrays()), place_planes(torch)
    seen = [on_plan(points, HEIGHT) for points in (POINTS, POINTS[::3] * 1.01)]
    together = answers(
        torch,
        network,
        torch.from_numpy(np.concatenate([one.inputs for one in seen])),
        torch.from_numpy(np.concatenate([seen[0].pillars, seen[1].pillars + PILLARS**2])),
        places,
        scans=2,
    )
    for number, one in enumerate(seen):
        alone = answers(
            torch, network, torch.from_numpy(one.inputs), torch.from_numpy(one.pillars), places
        )
        assert torch.allclose(alone[0], together[number], atol=1e-4)


def test_the_threads_of_pytorch_are_given_back_and_do_not_matter(file):
    detector, before = PillarsDetector(file), torch.get_num_threads()
    made = []
    for threads in (1, 2):
        torch.set_num_threads(threads)
        made.append(detector.answer(POINTS, HEIGHT))
        assert torch.get_num_threads() == threads
    torch.set_num_threads(before)
    assert np.array_equal(*made)


@pytest.mark.parametrize("points", [np.zeros((3, 2)), np.array([[1.0, np.nan, 0.0]])])
def test_points_that_are_none_are_refused(file, points):
    with pytest.raises(InvalidInput, match="points must be"):
        PillarsDetector(file).detect(points, HEIGHT)


def test_without_pytorch_the_extra_is_named(file, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "torch", None)
    with pytest.raises(MissingExtra, match=r"\.\[rl\]"):
        make_detector("pillars", HEIGHT, file=file)


def test_the_shipped_detector_finds_most_of_a_street():
    film = street_film(2500)
    made = make_detector("pillars", film.sensor_height_m)
    found = seen = 0
    for shot in film.shots[::10]:
        near = planar_ranges(shot.annotations.boxes) <= 50
        reported, _ = made.detect(shot.cloud, shot.annotations)
        found += found_objects(shot.annotations, reported)[near].sum()
        seen += near.sum()
    assert found > 0.75 * seen > 20


@pytest.mark.parametrize(("weights", "steps"), [("streets", 10_000), ("clutter", 400)])
def test_the_shipped_card_says_what_the_readme_does(weights, steps):
    made = PillarsDetector(weights=weights)
    both = (pillars.SHIPPED.parent / "README.md").read_text().partition("## `pillars-clutter.npz`")
    told = both[0] if weights == "streets" else both[2]
    result = made.card["result"]
    for name in ("recall, all scans", "recall, full scans", "precision, all scans"):
        assert f"{100 * result[name]:.1f}" in told
    assert f"{result['calibration error']:.3f}" in told
    assert made.card["steps"] == made.card["steps asked for"] == steps


def test_shipped_weights_are_known_by_what_they_learned_from(file):
    assert PillarsDetector(weights="clutter").card["data"].startswith("1600 scans of cluttered")
    with pytest.raises(InvalidInput, match=r"unknown weights of detector pillars 'roads'"):
        PillarsDetector(weights="roads")
    with pytest.raises(InvalidInput, match="give file or weights of detector pillars, not both"):
        PillarsDetector(file, weights="clutter")


def test_weights_whose_answer_is_no_number_are_told_of(tmp_path):
    """Each number is allowed, but 25 layers of them leave what float32 holds."""
    arrays = {name: array * np.float32(1e4) for name, array in drawn_arrays().items()}
    arrays[pillars.CALIBRATION][:] = 1, 0
    pillars.save_detector(tmp_path / "wild.npz", arrays, {})
    with pytest.raises(
        InvalidInput, match=r"^weights \S*wild\.npz: the network answers"
    ) as refused:
        PillarsDetector(tmp_path / "wild.npz").detect(POINTS, HEIGHT)
    assert "\n" not in str(refused.value)


def text(path):
    path.write_text("not weights")


def lacking(path):
    arrays = drawn_arrays()
    del arrays["body0.bias"]
    pillars.save_detector(path, arrays, {})


def of_another_shape(path):
    pillars.save_detector(path, drawn_arrays() | {"body0.bias": np.zeros(3)}, {})


def turned_round(path):
    pillars.save_detector(path, drawn_arrays() | {pillars.CALIBRATION: -np.ones((5, 2))}, {})


def of_another_format(path):
    write_arrays(path, drawn_arrays(), '{"format": "care-sim weights 1"}')


SPOILT = [text, lacking, of_another_shape, turned_round, of_another_format]


@pytest.mark.parametrize("spoil", SPOILT)
def test_a_wrong_file_is_refused_in_one_line_that_names_it(tmp_path, spoil):
    path = drawn_weights(tmp_path / "spoilt.npz")
    spoil(path)
    with pytest.raises(InvalidInput, match=r"spoilt\.npz") as refused:
        make_detector("pillars", HEIGHT, file=path)
    assert "\n" not in str(refused.value)
