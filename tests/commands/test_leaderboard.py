"""`care-sim leaderboard`: which files make a table, and what it says of the others."""

import re

from tests.helpers.commands import run
from tests.helpers.made_results import made_result


def test_a_file_of_another_version_is_left_out_and_the_others_are_shown(capsys, library):
    text = (library / "care.json").read_text()
    (library / "care.json").write_text(
        text.replace('"care_sim_benchmark": 1', '"care_sim_benchmark": 0')
    )
    code, out, err = run(capsys, "leaderboard", library)
    assert code == 1
    assert re.search(r"^1 +place", out, re.M)
    assert "is of version 0 of the benchmark" in err
    assert "care-sim benchmark --policy care" in err


def test_of_two_results_of_one_name_the_first_counts(capsys, library, here):
    made_result("care", 0.1).write(here / "mine.json")
    code, out, err = run(capsys, "leaderboard", library, "mine.json")
    assert code == 1
    assert f"left out: mine.json, since {library / 'care.json'} has its name and its code" in err
    assert out.count("care ") == 1


def test_leads_are_told_over_any_entry(capsys, library):
    code, out, _ = run(capsys, "leaderboard", library, "--minus", "care")
    assert code == 0
    assert "minus care" in out
    # 49.7 less 70.2.
    assert re.search(r"place +49\.7 .*-20\.5 ", out)
    told = run(capsys, "leaderboard", library, "--minus", "nobody")
    assert (told[0], "unknown entry 'nobody'; known: care, place" in told[2]) == (2, True)


def test_every_file_that_is_of_no_use_has_a_line(capsys, here):
    for name in ("a", "b"):
        (here / f"{name}.json").write_text("{")
    told = "left out: {}.json is cut off or no JSON: "
    code, out, err = run(capsys, "leaderboard", "a.json", "b.json", "c.json")
    assert (code, out, err.count("\n")) == (2, "", 3)
    for line, start in zip(
        err.splitlines(),
        (told.format("a"), told.format("b"), "left out: c.json cannot be read: No such file"),
        strict=True,
    ):
        assert line.startswith(f"care-sim: {start}")


def test_two_of_one_name_and_different_code_are_two_entries(capsys, here):
    for n, code in enumerate(("aaaaaaaaaaaa", "bbbbbbbbbbbb")):
        made = {"policy_code": code, "versions": {"code": code}}
        made_result("mine:Mine", n, made_by=made).write(here / f"{n}.json")
    code, out, _ = run(capsys, "leaderboard", ".")
    assert code == 0
    assert re.findall(r"mine:Mine (#\w+)", out) == ["#bbbbbbb", "#aaaaaaa"]
    # A lead is told over the name that the table shows.
    out = run(capsys, "leaderboard", ".", "--minus", "mine:Mine #aaaaaaa")[1]
    assert re.search(r"mine:Mine .*\+100\.0", " ".join(out.split()))


def test_a_chart_is_written_in_both_formats_where_it_is_told(capsys, library, here):
    code, out, _ = run(capsys, "leaderboard", library, "--chart", "mine.svg")
    assert (code, out.splitlines()[-1]) == (0, "Chart: mine.svg")
    assert (here / "mine.svg").read_text().startswith("<?xml")
    assert (here / "mine.png").read_bytes().startswith(b"\x89PNG")
