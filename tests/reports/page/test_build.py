"""What a page is made of, and in which order."""

import re

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.reports.page import build
from care_sim.reports.page.budget_charts import budget_charts
from care_sim.reports.page.build import CHARTS, write_page
from care_sim.reports.page.crowding_charts import crowding_charts
from care_sim.reports.report import StudyReport
from care_sim.reports.studies import STUDIES
from care_sim.study.rows.parquet import write_rows
from tests.helpers.made_rows import CROWD, STUDY, rows


def test_charts_are_those_of_studies_and_every_study_has_a_title():
    assert {*CHARTS} <= {*STUDIES}
    assert len({study.title for study in STUDIES.values()}) == len(STUDIES)


def test_what_cannot_be_drawn_fails_before_an_episode_is_played(tmp_path, monkeypatch):
    def broken(_rows):
        raise InvalidInput("no chart of these rows")

    monkeypatch.setitem(build.CHARTS, "sweep", broken)
    write_rows(STUDY, tmp_path / "episodes.parquet")
    with pytest.raises(InvalidInput, match="no chart"):
        write_page(
            tmp_path,
            tmp_path / "report.html",
            3,
            1,
            lambda _workers: pytest.fail("an episode is played"),
        )


def test_one_is_singular(tmp_path):
    once = rows("care", [9.0], budget=0.05) + rows("care", [9.0], budget=0.1)
    (chart,) = budget_charts(once)
    assert chart.title == "dense: first detection against the budget, 1 seed a point"
    (chart,) = crowding_charts([row for row in CROWD if row["seed"] == 0])
    assert chart.title.endswith("m, 1 seed")
    write_rows(once[:1], tmp_path / "episodes.parquet")
    write_page(tmp_path, tmp_path / "report.html", 0, 1)
    assert "<small>1 configuration, 1 seed</small>" in (tmp_path / "report.html").read_text()


def test_the_page_holds_how_to_read_its_tables(tmp_path):
    write_rows(STUDY, tmp_path / "episodes.parquet")
    write_page(tmp_path, tmp_path / "report.html", 0, 1)
    page = (tmp_path / "report.html").read_text()
    assert '<a href="#reading">How to read the tables</a>' in page
    assert "<td>metres from the LiDAR" in page
    first, *_ = StudyReport.of(STUDY).texts["tables.md"].splitlines()
    assert first == "[How to read the tables](../../docs/reading.md)"


def test_directions_and_control_codes_in_names_are_shown_as_escapes(tmp_path):
    turned = [row | {"policy": "mine\u202e\x1b"} for row in STUDY if row["policy"] == "history"]
    folder = tmp_path / "runs\u2066"
    folder.mkdir()
    another = rows("care", [9.0], budget=0.1)
    write_rows([*STUDY, *turned, *another], folder / "episodes.parquet")
    write_page(folder, tmp_path / "report.html", 0, 1)
    page = (tmp_path / "report.html").read_text()
    assert not {"\u202e", "\u2066", "\x1b"} & {*page}
    assert "\\u001b" not in page
    # In the tables and the list of episodes, then in the charts, and in the page's own heading.
    assert "mine\\u202e\\x1b" in page
    assert "mine\\\\u202e\\\\x1b" in page
    assert "<b>runs\\u2066</b>" in page


def test_a_page_leaves_out_empty_columns(tmp_path):
    def page_of(rows):
        write_rows(rows, tmp_path / "episodes.parquet")
        write_page(tmp_path, tmp_path / "report.html", 0, 1)
        return (tmp_path / "report.html").read_text()

    def headings(page):
        return re.findall(r'<th scope="col"><button type="button">(.*?)</button>', page)

    whole, without = page_of(STUDY), page_of([row for row in STUDY if row["policy"] != "full"])
    assert {"regret m", "as full"} <= {*headings(whole)}
    assert {"regret m", "as full"}.isdisjoint(headings(without))


def test_a_page_says_where_one_number_of_a_policy_comes_from(tmp_path):
    write_rows(STUDY, tmp_path / "episodes.parquet")
    write_page(tmp_path, tmp_path / "report.html", 0, 1)
    assert "<code>care-sim benchmark --policy NAME</code>" in (tmp_path / "report.html").read_text()
