"""The parts of a page, and their order."""

import re
from dataclasses import replace

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.reports.page.build import write_page
from care_sim.reports.studies import STUDIES
from care_sim.study.rows.parquet import write_rows
from tests.helpers.made_rows import STUDY, rows

SWEEP = [*STUDY, *rows("care", [9.0], budget=0.1)]


def test_what_cannot_be_drawn_fails_before_an_episode_is_played(tmp_path, monkeypatch):
    def broken(_rows):
        raise InvalidInput("no figure of these rows")

    monkeypatch.setitem(STUDIES, "sweep", replace(STUDIES["sweep"], figures=broken))
    write_rows(STUDY, tmp_path / "episodes.parquet")
    with pytest.raises(InvalidInput, match="no figure"):
        write_page(
            tmp_path,
            tmp_path / "report.html",
            3,
            1,
            lambda _workers: pytest.fail("an episode is played"),
        )


def test_figures_of_a_page_share_no_id_and_bring_no_style(tmp_path):
    both = [row | {"scenario": name} for row in SWEEP for name in ("dense", "dartout")]
    write_rows(both, tmp_path / "episodes.parquet")
    write_page(tmp_path, tmp_path / "report.html", 0, 1)
    first, second = re.findall(r"<svg.*?</svg>", (tmp_path / "report.html").read_text(), re.DOTALL)
    ids = [set(re.findall(r' id="(.*?)"', each)) for each in (first, second)]
    assert all(ids)
    assert not ids[0] & ids[1]
    assert "<style" not in first
    assert {*re.findall(r"url\(#(.*?)\)", first)} <= ids[0]


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
    # In the tables and the list of episodes, then in the figures, and in the page's own heading.
    assert "<td>mine\\u202e\\x1b</td>" in page
    assert ">mine\\u202e\\x1b</text>" in page
    assert "<b>runs\\u2066</b>" in page
