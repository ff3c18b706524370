"""The short form of the campaigns: a few cases of each, the same every time, and those that once
went wrong.
"""

from itertools import islice

import pytest

from tests.torture.case import CAMPAIGNS, Case, Fault, Name, found
from tests.torture.field import Field, names
from tests.torture.judge import ending
from tests.torture.processes import Command
from tests.torture.wrong import KINDS, WAYS

SHORT = {
    "commands": 24,
    "calls": 150,
    "files": 14,
    "recordings": 30,
    "studies": 2,
    "folders": 16,
    "surroundings": 44,
}
"""Cases of each campaign: with what once went wrong, 47 seconds on two cores."""


@pytest.fixture(scope="module")
def field():
    with Field(1) as field:
        yield field


def told(tally):
    return "\n\n".join(map(str, tally.failures))


@pytest.mark.slow
@pytest.mark.parametrize("campaign", CAMPAIGNS)
def test_nothing_but_one_clear_line(field, campaign):
    tally = field.play(islice(names(campaign, 0), SHORT[campaign]))
    assert not tally.failures, told(tally)
    assert sum(tally.endings.values()) == SHORT[campaign]


@pytest.mark.slow
@pytest.mark.parametrize("campaign", [*filter(found, CAMPAIGNS)])
def test_what_went_wrong_once_stays_right(field, campaign):
    tally = field.play(found(campaign))
    assert not tally.failures, told(tally)


def test_a_case_is_its_name():
    texts = ("files:1:2", "files:1:2", "files:2:1")
    one, again, other = (Case(Name.of(text)).rng.random() for text in texts)
    assert one == again != other
    assert str(Name.of("files:1:2")) == "files:1:2"


@pytest.mark.parametrize(
    ("code", "err", "kind"),
    [
        (2, "Traceback (most recent call last):\n  File ...\nKeyError: 5\n", "KeyError"),
        (2, "", "exit code 2 without a last line"),
        (2, "care-sim: a\ncare-sim: b\n", "more than one line"),
        (2, "care-sim: \n", "says nothing"),
        (2, "care-sim: \x1b[31m\n", "control codes"),
        (2, "care-sim: ----- Error\n", "rules of a box"),
        (2, "care-sim: KeyError: 5\n", "bare exception"),
        (1, "care-sim: failed: dense care: ValueError: x (world.py, line 3)\n", "exception told"),
        (1, "", "without a reason"),
        (3, "care-sim: x\n", "exit code 3"),
        (70, "care-sim: unexpected KeyError: 5; please report it\n", "fault of the software"),
        (0, "/x/y.py:3: RuntimeWarning: overflow\n", "neither its own"),
    ],
)
def test_the_judge_knows_a_fault(code, err, kind):
    with pytest.raises(Fault, match=kind):
        ending(code, "", err)


@pytest.mark.parametrize(
    ("code", "err", "ended"),
    [
        (0, "", "done"),
        (0, "2 of 9 episodes found in x\nepisodes 3/9, 5 s left\n", "done"),
        (
            0,
            "1 line of x/journal.jsonl passed over, "
            "damaged or of a version that wrote no checksums\n",
            "done",
        ),
        (141, "", "interrupted"),
        (1, "care-sim: left out: policy torn cannot be loaded\n", "refused"),
        (2, "care-sim: budget must lie in (0, 1], got 2\n", "refused"),
        (130, "care-sim: interrupted\n", "interrupted"),
        (-2, "care-sim: interrupted\n", "interrupted"),
        (-3, "care-sim: interrupted\n", "interrupted"),
    ],
)
def test_the_judge_knows_a_good_ending(code, err, ended):
    assert ending(code, "", err) == ended


def test_the_field_sees_a_hang_a_death_and_too_much_memory(field):
    tally = field.play([Name("wrong", 0, number) for number in range(len(WAYS))])
    assert [failure.kind for failure in tally.failures] == [*KINDS]


def test_a_process_left_behind_is_seen(tmp_path, monkeypatch):
    monkeypatch.setattr("tests.torture.processes.LEAVES_S", 0.3)
    leaves = (
        "import subprocess, sys; "
        "subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])"
    )
    monkeypatch.setattr("tests.torture.processes.entry_point", lambda: leaves)
    with Command([], tmp_path) as command:
        assert command.wait() == 0
        with pytest.raises(Fault, match="processes left behind"):
            command.check_gone()
    assert not command.others()
