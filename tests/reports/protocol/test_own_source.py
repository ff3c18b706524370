"""The paper measured nuScenes: of films of one's own source it says nothing, and nothing of it
stands beside them.
"""

import re

import pytest

from care_sim.reports.report import StudyReport
from care_sim.reports.studies import STUDIES
from care_sim.sources.scenes import Scene, Streets
from care_sim.study.designs.ablations import ablation_plays
from tests.helpers.made_plays import found, play, study

_FOUND = {
    "history": (4, 6),
    "all-camera": (6, 5),
    "care": (6, 5),
    "care-sbf": (5, 5),
    "full": (8, 8),
}
_SCENES = [Scene(f"street-{seed:04d}", seed) for seed in range(2)]


def _ablated():
    for config in ablation_plays(Streets("evaluation"), _SCENES, [0.1]):
        row = config.row()
        given = {name: row[name] for name in row if name not in ("source", "scene", "policy")}
        yield play(config.scene.name, config.policy, found(9, 3), [5] * 9, released=2.0, **given)


@pytest.mark.parametrize(
    ("name", "rows"), [("protocol", study(_FOUND)), ("ablate-open-loop", [*_ablated()])]
)
def test_nothing_of_the_paper_stands_beside_films_of_ones_own_source(name, rows):
    assert _of_paper(name, rows)
    assert not _of_paper(name, [row | {"source": "mine"} for row in rows])


def _of_paper(name, rows):
    """The lines that hold the paper's figures or sentences, and the figures' labels of them."""
    report = StudyReport.of(rows, STUDIES[name])
    lines = report.texts["tables.md"].splitlines()
    labels = [
        line.get_label()
        for figure in report.figures.values()
        for axes in figure.axes
        for line in axes.lines
    ]
    return [
        line for line in [*lines, *labels] if re.search(r"\(paper|[Pp]aper:|paper's stat", line)
    ]
