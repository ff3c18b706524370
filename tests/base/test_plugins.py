"""Things by name: built-in ones and those of installed packages."""

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.plugins import Plugins

MODULE = """
import sys


def ours():
    return "ours"


def theirs():
    return "theirs"


number = 3


def __getattr__(name):
    sys.exit("leaves\\nin two lines")
"""


def faults(made):
    if not callable(made):
        yield f"is the number {made}"


THINGS = Plugins("thing", "care_sim.things", {"usual": lambda: "usual"}, faults)


@pytest.fixture
def installed(install):
    """Two packages; `ahead` comes first on the path."""
    install("behind", MODULE, THINGS.group, twin="theirs", usual="theirs", rude="missing")
    install("ahead", MODULE, THINGS.group, twin="ours", number="number")


def test_built_in_names_come_first_and_others_in_alphabetical_order(installed):
    assert THINGS.names() == ["usual", "number", "rude", "twin"]


def test_a_built_in_name_is_taken_and_of_two_the_first_on_the_path_counts(installed):
    assert (THINGS.maker("usual")(), THINGS.maker("twin")()) == ("usual", "ours")


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("mine", "; a thing in a file is MODULE:CLASS, as mine:Mine; known: usual"),
        ("mine.py", "; a thing in a file is MODULE:CLASS, as mine:Mine; known: usual"),
        ("mine.py:Own", "; a thing in a file is MODULE:CLASS, as mine:Own; known: usual"),
        ("./mine.py:Own", "; a thing in a file is MODULE:CLASS, as mine:Own; known: usual"),
        ("my_own", "; a thing in a file is MODULE:CLASS, as my_own:MyOwn; known: usual"),
        ("other", "; known: usual"),
        ("a-b", "; known: usual"),
        (("mine",), "; known: usual"),
        ("usal", "; the nearest is usual; known: usual"),
    ],
)
def test_an_unknown_name_is_told_with_the_file_that_is_meant_and_the_nearest_first(
    name, told, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for file in ("mine.py", "my_own.py", "a-b.py"):
        (tmp_path / file).touch()
    with pytest.raises(InvalidInput) as refused:
        THINGS.check(name)
    _, hints = str(refused.value).split(str(name), 1)
    assert hints.lstrip("'\")") == told


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("number", "ahead:number is the number 3"),
        ("rude", "SystemExit: leaves in two lines"),
        ("nobody", "unknown thing 'nobody'"),
    ],
)
def test_what_cannot_be_made_is_one_line(installed, name, reason):
    with pytest.raises(InvalidInput) as error:
        THINGS.maker(name)
    assert str(error.value).startswith(reason)
    assert "\n" not in str(error.value)


def test_a_folder_that_hides_the_module_is_named(install, tmp_path, monkeypatch):
    """As a folder of data beside the script does, whose name is the package's."""
    install("shadowed", MODULE, THINGS.group, hidden="ours")
    (tmp_path / "shadowed" / "shadowed.py").unlink()
    folder = tmp_path / "work" / "shadowed"
    folder.mkdir(parents=True)
    monkeypatch.syspath_prepend(str(folder.parent))
    with pytest.raises(InvalidInput, match=rf"no attribute 'ours' \(found in {folder}\)"):
        THINGS.maker("hidden")


def test_a_kind_may_call_its_entries_otherwise(install):
    called = Plugins("thing", "care_sim.called", {"usual": min}, faults, str.lower)
    install("loud", MODULE, called.group, TWIN="ours", Usual="theirs")
    install("louder", MODULE, called.group, Twin="theirs")
    assert called.names() == ["usual", "twin"]
    assert called.maker("twin")() == "theirs"
    assert [line for _, line in called.refusals()] == [
        "thing twin of loud 1.5 is refused: that of louder 1.5 has its name",
        "thing usual of loud 1.5 is refused: the built-in one has its name",
    ]
    with pytest.raises(InvalidInput, match="unknown thing 'TWIN'"):
        called.maker("TWIN")
