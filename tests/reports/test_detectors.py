"""The tables and the figure of detectors, of scenes worked by hand."""

import numpy as np
import pytest

from care_sim.evaluation.detector_quality import SceneBoxes
from care_sim.reports.detectors import detector_tables
from care_sim.reports.figures.detectors import detectors_figure
from care_sim.study.judging import JudgedScene


def scene(scores, right, found_at):
    """Cars, the first of which is a first sighting."""
    boxes = SceneBoxes(
        np.array(scores, float),
        np.zeros(len(scores), np.int64),
        np.array(right, bool),
        np.array(found_at, float),
        np.zeros(len(found_at), np.int64),
        np.array([0]),
        2,
    )
    return JudgedScene(boxes, np.array([4.0, 6.0]), {}, {})


PLAIN = scene([1, 1], [True, False], [-np.inf, 1])
SURE = scene([0.9, 0.8, 0.4, 0.2], [True, True, False, False], [0.9, 0.8])


def rows(judged, least=(0.3,)):
    return detector_tables(judged, least, "plain")[0].rows


def test_shares_and_what_is_found_at_the_precision_of_another():
    plain, at_least, alike = rows({"plain": [PLAIN], "sure": [SURE]})
    assert plain == ("plain", "-", "0.0", "50.0", "50.0", "1.0", "-", "5.0", "-", "-")
    assert at_least[1:6] == ("0.3", "100.0", "100.0", "66.7", "1.5")
    # From 0.2 on half of its boxes are right, as of all of the other's; one scene has no interval.
    assert alike[1] == "0.200 *"
    assert alike[-2:] == ("+100.0", "+50.0")


def test_five_scenes_have_an_interval():
    *_, alike = rows({"plain": [PLAIN] * 5, "sure": [SURE] * 5})
    assert alike[-1] == "+50.0 [50.0,50.0]"


def test_no_row_where_the_precision_is_out_of_reach():
    wrong = scene([0.9, 0.5], [False, False], [-np.inf, -np.inf])
    *_, told = rows({"plain": [PLAIN], "wrong": [wrong]})
    assert told == ("wrong", "none *", "-", "-", "-", "-", "70.0", "5.0", "-", "-")


def test_class_by_class_at_the_precision_of_the_other():
    """Two thirds of the boxes of the other are right, and from 0.4 on of the sure ones."""
    judged = {"other": [scene([1, 1, 1], [True, True, False], [1, 1])], "sure": [SURE]}
    _, by_class = detector_tables(judged, [0.85], "other")
    *_, at_least, alike = by_class.rows
    assert at_least[:6] == ("sure", "0.85", "50.0", "100.0", "-", "-")
    assert alike[:6] == ("sure", "*", "100.0", "66.7", "-", "-")


def test_every_detector_has_its_name_at_the_end_of_its_curve():
    few, many = [19, 0.1, 0.0], [20, 0.9, 0.8]
    steps = {"plain": [[1.0, 0.5, 0.9]], "sure": [[0.9, 0.2, 1.0], [0.4, 0.6, 0.7]], "none": []}
    figure = detectors_figure(
        {
            name: {"score, recall, precision": own, "boxes, mean score, share right": [few, many]}
            for name, own in steps.items()
        }
    )
    left, right = figure.axes
    names = {text.get_text(): text.xy for text in left.texts}
    assert {*names} == {"plain", "sure"}
    assert names["plain"] == pytest.approx((50, 90))
    assert names["sure"] == pytest.approx((60, 70))
    # A tenth of few boxes says little.
    assert right.lines[0].get_xydata().tolist() == [[0.9, 0.8]]
