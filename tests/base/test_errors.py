"""The owner of the code that raised an error."""

import site
import sysconfig
from pathlib import Path

import pytest

import care_sim
from care_sim.base.errors import foreign_place

LIBRARIES = [
    sysconfig.get_path("stdlib"), sysconfig.get_path("purelib"), site.getusersitepackages(),
    *site.getsitepackages(), str(Path(care_sim.__file__).parent),
]  # fmt: skip


def raised_in(file):
    """An error that a function of that file has raised."""
    told = {}
    exec(compile("\ndef fall():\n    raise OSError('no')\n", file, "exec"), told)
    with pytest.raises(OSError, match="no") as raised:
        told["fall"]()
    # Without the frames of the test, which are somebody's code, too.
    return raised.value.with_traceback(raised.tb.tb_next)


def test_the_file_and_line_of_a_users_code_are_told(tmp_path):
    assert foreign_place(raised_in(str(tmp_path / "mine.py"))) == " (mine.py, line 3)"


@pytest.mark.parametrize("folder", LIBRARIES)
def test_code_of_a_library_is_nobodys_wherever_it_was_installed(folder):
    assert foreign_place(raised_in(str(Path(folder) / "library" / "file.py"))) == ""


@pytest.mark.parametrize("error", [OSError(24, "Too many open files"), MemoryError()])
def test_without_the_list_of_plugins_a_librarys_code_is_nobodys(monkeypatch, error):
    def fail():
        raise error

    monkeypatch.setattr("care_sim.base.errors.entry_points", fail)
    assert foreign_place(raised_in(f"{sysconfig.get_path('purelib')}/library.py")) == ""
