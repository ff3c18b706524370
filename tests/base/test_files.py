"""Files that are there whole or not at all."""

import contextlib
import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.base.files import PNG, check_output, replacing, write_text


def test_the_old_file_stays_until_the_new_one_is_whole(tmp_path):
    file = tmp_path / "deeper" / "table.csv"
    for text in ("old", "new"):
        with replacing(file) as unfinished:
            assert unfinished.suffix == ".csv"
            unfinished.write_text(text)
            assert not file.exists() or file.read_text() == "old"
    assert file.read_text() == "new"
    with contextlib.suppress(RuntimeError), replacing(file) as unfinished:
        unfinished.write_text("half")
        raise RuntimeError
    assert file.read_text() == "new"
    assert list(file.parent.iterdir()) == [file]


def test_a_file_has_one_writer_at_a_time(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with replacing(tmp_path / "table.csv") as unfinished:
        with pytest.raises(InvalidInput, match=r"table\.csv is being written already"):
            replacing(unfinished.with_name("table.csv").relative_to(tmp_path)).__enter__()
        unfinished.write_text("whole")
    assert (tmp_path / "table.csv").read_text() == "whole"


def test_what_a_killed_writer_left_goes_and_what_a_live_one_writes_stays(tmp_path):
    program = (
        "import os, sys; from pathlib import Path; from care_sim.base.files import replacing\n"
        "with replacing(Path(sys.argv[1])) as unfinished:\n"
        "    print(unfinished.name, flush=True); sys.stdin.read(1); os.kill(os.getpid(), 9)"
    )
    file = tmp_path / "table.csv"
    with subprocess.Popen(
        [sys.executable, "-c", program, str(file)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as writer:
        unfinished = tmp_path / writer.stdout.readline().strip()
        with pytest.raises(InvalidInput, match="being written already"):
            check_output(file)
        assert unfinished.exists()  # it is alive
        writer.communicate("x")
    check_output(file)
    assert not [*tmp_path.iterdir()]


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match="is a folder"), replacing(tmp_path):
        pass


@pytest.mark.parametrize("target", ["far/theirs", "far/nowhere", "/dev/null", "out.csv"])
def test_a_link_is_replaced_and_its_target_stays(target, tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "theirs").write_text("theirs")
    (tmp_path / "out.csv").symlink_to(target)
    write_text(tmp_path / "out.csv", "ours")
    assert not (tmp_path / "out.csv").is_symlink()
    assert (tmp_path / "out.csv").read_text() == "ours"
    assert [path.name for path in (tmp_path / "far").iterdir()] == ["theirs"]
    assert (tmp_path / "far" / "theirs").read_text() == "theirs"


def test_a_link_under_the_name_of_the_unfinished_file_is_not_followed(tmp_path):
    with replacing(tmp_path / "table.csv") as unfinished:
        name = unfinished.name
    (tmp_path / name).symlink_to("theirs")
    write_text(tmp_path / "table.csv", "ours")
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]


def test_a_link_to_a_folder_is_a_folder(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "out").symlink_to("far")
    write_text(tmp_path / "out" / "table.csv", "ours")
    assert (tmp_path / "far" / "table.csv").read_text() == "ours"
    (tmp_path / "nowhere").symlink_to("missing")
    with pytest.raises(OSError, match=r"nowhere"):
        write_text(tmp_path / "nowhere" / "table.csv", "ours")
    assert not (tmp_path / "missing").exists()
    (tmp_path / "round").symlink_to("round")
    with pytest.raises((InvalidInput, OSError), match=r"round"):
        check_output(tmp_path / "round" / "table.csv")


def test_the_rights_of_a_file_stay(tmp_path):
    file = tmp_path / "secret.json"
    file.touch(0o600)
    write_text(file, "{}")
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_a_pipe_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InvalidInput, match="pipe is a device, a pipe or a socket"):
        check_output(tmp_path / "pipe")
    assert (tmp_path / "pipe").is_fifo()


@pytest.mark.parametrize(
    ("old", "allowed"), [(b"", True), (b"\x89PNG..", True), (b"PAR1....", False), (b"hello", False)]
)
def test_a_file_of_another_kind_is_refused_before_anything_is_computed(old, allowed, tmp_path):
    file = tmp_path / "mine.png"
    file.write_bytes(old)
    if allowed:
        check_output(file, PNG)
    else:
        with pytest.raises(
            InvalidInput, match=r"mine\.png holds something else .*: remove it first"
        ):
            replacing(file, PNG).__enter__()
    assert file.read_bytes() == old


def test_a_name_too_long_is_refused_at_once_and_the_longest_is_written(tmp_path):
    with pytest.raises(OSError, match="too long"):
        check_output(tmp_path / ("n" * 256))
    longest = tmp_path / ("ä" * 125 + ".json")
    write_text(longest, "{}")
    assert [path.name for path in tmp_path.iterdir()] == [longest.name]


def test_nothing_is_written_but_through_one_door():
    """A file of the package that is opened to be written is one that `replacing` has given;
    journals alone grow.
    """
    package = Path(care_sim.__file__).parent
    writes = re.compile(
        r"(\w+)\.write_(?:text|bytes)\(|(\w+)\.open\(\s*\"[wax]|\bopen\((\w+), \"[wax]"
        r"|savefig\((\w+)|to_parquet"
    )
    found = {
        (file.name, next(filter(None, match.groups()), ""))
        for file in package.rglob("*.py")
        for match in writes.finditer(file.read_text())
    }
    assert {name for name, receiver in found if receiver.lstrip("_") != "unfinished"} == {
        "files.py",
        "journal.py",
    }
