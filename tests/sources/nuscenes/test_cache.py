"""Tables that are kept in files: made once, made anew when they must be."""

import os
from concurrent.futures import ThreadPoolExecutor
from time import sleep

import pyarrow as pa
import pytest

from care_sim.sources.nuscenes.table_files import cached_table

PLACE = "kept.arrow"


class Maker:
    """Makes a table of a source, and counts how often."""

    def __init__(self, source):
        self.source = source
        self.made = 0

    def __call__(self):
        self.made += 1
        return pa.table({"rows": [[{"text": self.source.read_text()}], []]})

    def cached(self, form="1"):
        table = cached_table(self.source.parent / PLACE, form, [self.source], self)
        return table["rows"].to_pylist()


@pytest.fixture
def maker(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    folder = tmp_path / "data"
    folder.mkdir()
    source = folder / "source.json"
    source.write_text("one")
    return Maker(source)


def kept(text):
    return [[{"text": text}], []]


def test_a_table_is_made_once(maker):
    assert [maker.cached() for _ in range(3)] == [kept("one")] * 3
    assert maker.made == 1
    assert {path.name for path in maker.source.parent.iterdir()} == {PLACE, "source.json"}


def test_a_changed_source_is_read_again_though_its_size_and_time_are_as_before(maker):
    maker.cached()
    before = maker.source.stat()
    maker.source.write_text("two")
    os.utime(maker.source, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert maker.cached() == kept("two")


@pytest.mark.parametrize("size", [0, 10, 200, -1])
def test_a_torn_table_is_made_anew(maker, size):
    maker.cached()
    place = maker.source.parent / PLACE
    os.truncate(place, size if size >= 0 else place.stat().st_size - 1)
    assert [maker.cached() for _ in range(2)] == [kept("one")] * 2
    assert maker.made == 2


def test_beside_data_that_cannot_be_written_it_is_kept_in_the_users_cache(maker, tmp_path):
    (maker.source.parent / PLACE).mkdir()
    assert [maker.cached() for _ in range(3)] == [kept("one")] * 3
    assert maker.made == 1
    assert [*(tmp_path / "caches").rglob("*.arrow")]


def test_a_file_of_somebody_else_stays(maker):
    place = maker.source.parent / PLACE
    place.write_text("mine")
    assert maker.cached() == kept("one")
    assert place.read_text() == "mine"


def test_where_nothing_can_be_written_every_process_makes_its_own(maker, tmp_path):
    (maker.source.parent / PLACE).mkdir()
    (tmp_path / "caches").write_text("a file")
    assert [maker.cached() for _ in range(2)] == [kept("one")] * 2
    assert maker.made == 2


def test_who_wants_it_meanwhile_waits(maker):
    make = maker.__call__

    def slow():
        sleep(0.2)
        return make()

    def ask(_):
        return cached_table(maker.source.parent / PLACE, "1", [maker.source], slow)

    with ThreadPoolExecutor(4) as pool:
        tables = [*pool.map(ask, range(4))]
    assert maker.made == 1
    assert all(table["rows"].to_pylist() == kept("one") for table in tables)
