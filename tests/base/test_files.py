"""Files that are there whole or not at all, where they do not fit, and JSON from a user's files."""

import contextlib
import json
import os
import re
import resource
import stat
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from PIL import Image

import care_sim
from care_sim.base import files
from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.base.files import (
    MOST_BYTES,
    PNG,
    check_output,
    listed_values,
    replacing,
    write_text,
)
from care_sim.core.grid import AngularGrid
from care_sim.policies.learned import weights
from care_sim.policies.learned.weights import load_weights
from care_sim.reports.figures.styles import save
from care_sim.reports.page.build import CONFIG, description_in
from care_sim.sources.nuscenes.table_files import LARGEST_TABLE, read_json
from care_sim.study.journal import LARGEST_JOURNAL, Journal
from care_sim.study.rows.parquet import write_rows
from care_sim.training.folder import read_config
from care_sim.viewer.pictures.clip_files import write_clip


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


def test_a_pipe_and_what_is_the_systems_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/stdout"), Path("/dev/null"), Path("/dev/new")):
        with pytest.raises(InvalidInput, match=f"{path} is a device, a pipe or a socket"):
            check_output(path)
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
    """A file of the package that is opened to be written is one that `replacing` has given, or a
    text in memory; journals alone grow.
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
    assert {
        name for name, receiver in found if receiver.lstrip("_") not in ("unfinished", "drawn")
    } == {
        "files.py",
        "journal.py",
    }


RNG = np.random.default_rng(0)
PICTURES = [Image.fromarray(RNG.integers(0, 255, (240, 320, 3), dtype=np.uint8)) for _ in range(3)]


def clip(path):
    write_clip(path, PICTURES, 0.1, 0.2)


def mp4(path):
    pytest.importorskip("imageio_ffmpeg")
    clip(path)


def recording(path):
    pytest.importorskip("rerun")
    from care_sim.viewer.recording.recording import Recording

    Recording(path, ["care"]).close()


def scans(path):
    import gymnasium

    from care_sim.wrappers import ExportScans

    with ExportScans(
        gymnasium.make("care_sim:CARE-Dartout-v0", duration_s=0.2, budget=1.0), path.parent
    ) as env:
        env.reset(seed=0)
        env.step(np.ones(env.action_space.shape, np.float32))


def arrays(path):
    weights.save_weights(path, {"layer": RNG.random(10_000)}, weights.Card("ppo", AngularGrid()))


def rows(path):
    write_rows([{"digest": str(n), "value": n / 7} for n in RNG.random(5_000)], path)


def figure(path):
    drawn = Figure()
    drawn.subplots().imshow(RNG.random((99, 99)))
    save(drawn, path.with_suffix(""))


@contextmanager
def no_file_larger_than(size):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


every_writer = pytest.mark.parametrize(
    ("write", "name"),
    [
        (mp4, "a.mp4"),
        (clip, "a.gif"),
        (clip, "a.webp"),
        (clip, "a.png"),
        (recording, "a.rrd"),
        (scans, "000.pcd"),
        (arrays, "a.npz"),
        (rows, "a.parquet"),
        (figure, "a.png"),
    ],
)


@every_writer
def test_a_file_that_does_not_fit_is_named_and_nothing_of_it_is_left(write, name, tmp_path):
    try:
        write(tmp_path / "whole" / name)
    except MissingExtra as missing:
        pytest.skip(str(missing))
    assert (tmp_path / "whole" / name).stat().st_size > 5_000
    file = tmp_path / "out" / name
    with no_file_larger_than(5_000), pytest.raises(OSError, match=r".") as error:
        write(file)
    assert error.value.filename == str(file)
    assert "File too large" in error.value.strerror
    assert [path.name for path in file.parent.iterdir() if path.name != "episode.json"] == []


DEEP = "[" * 100_000 + "]" * 100_000


def test_every_reader_says_in_one_line_that_a_file_is_too_deep(tmp_path):
    table = tmp_path / "scene.json"
    table.write_text(DEEP)
    with pytest.raises(InvalidInput, match=r"scene\.json: no readable JSON file .*deep"):
        read_json(table)
    weights = tmp_path / "weights.npz"
    np.savez(weights, card=np.frombuffer(DEEP.encode(), np.uint8))
    with pytest.raises(InvalidInput, match=r"weights\.npz: no \.npz of weights .*deep"):
        load_weights(weights)
    (tmp_path / CONFIG).write_text(DEEP)
    description, (trouble,) = description_in(tmp_path)
    assert description == {}
    assert "deep" in trouble


def zeros(path, size):
    """So many bytes that take no space, or without a size a pipe."""
    path.unlink(missing_ok=True)
    if size is None:
        os.mkfifo(path)
    else:
        path.touch()
        os.truncate(path, size)


@pytest.mark.parametrize(
    ("more", "reason"),
    [(1, r"it holds \d+ bytes and may hold \d+"), (None, "it is not a regular file")],
)
def test_every_reader_refuses_what_is_too_large_before_it_is_read(
    tmp_path, monkeypatch, more, reason
):
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: pytest.fail("it is read"))
    path = tmp_path / CONFIG
    zeros(path, more and LARGEST_TABLE + more)
    with pytest.raises(InvalidInput, match=rf"config\.json: no readable JSON file \({reason}"):
        read_json(path)
    zeros(path, more and LARGEST_JOURNAL + more)
    with pytest.raises(InvalidInput, match=rf"config\.json is no journal: {reason}"):
        Journal(path)
    zeros(path, more and MOST_BYTES + more)
    with pytest.raises(InvalidInput, match=rf"config\.json is damaged: {reason}"):
        read_config(path)
    description, (trouble,) = description_in(path.parent)
    assert description == {}
    assert "cannot be read (it " in trouble


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)


@pytest.fixture
def narrow(monkeypatch):
    """A reader that sees few characters at a time."""
    monkeypatch.setattr(files, "_CHUNK", 400)
    monkeypatch.setattr(files, "MOST_CHARACTERS", 400)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(VALUES, max_size=30), st.sampled_from([None, 0, 2]), st.booleans())
def test_a_list_is_read_value_by_value_as_it_is_read_whole(tmp_path, narrow, values, indent, plain):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(values, indent=indent, ensure_ascii=plain) + "\n", encoding="utf-8")
    assert [*listed_values(path)] == values


WRONG = {
    "": "no list",
    "{}": "no list",
    "[": "Expecting value",
    "[1": "neither a comma nor the end",
    "[1,": "value 2 is no JSON .*Expecting value",
    "[1,]": "value 2 is no JSON .*Expecting value",
    "[1 2]": "neither a comma nor the end",
    "[1]]": "text after the end",
    "[] 1": "text after the end",
    '[{"a": 1': "delimiter",
    f"[{DEEP}]": "deep",
}


@pytest.mark.parametrize("text", WRONG, ids=range(len(WRONG)))
def test_what_is_no_list_is_a_value_error(tmp_path, text):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=WRONG[text]):
        [*listed_values(path)]


def test_values_come_before_the_end_of_the_file_is_read(tmp_path, narrow):
    path = tmp_path / "a.json"
    path.write_text("[" + "1," * 10_000 + "!")
    assert next(listed_values(path)) == 1
