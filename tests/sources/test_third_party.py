"""A source from outside: the documented example and recordings of one's own, through the same doors
as ours.
"""

import sys

import gymnasium
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.cli import main
from care_sim.reports.report import read_results
from care_sim.sources.installed import SOURCES
from care_sim.sources.named import source_of
from care_sim.study.play_config import PlayConfig
from tests.helpers.places import ROOT, example, fenced

CROSSINGS = example("source")
LOGS = '''
from dataclasses import dataclass
from care_sim.sources.argoverse2.recordings import argoverse2_film, logs
from care_sim.sources.recordings import Recordings


@dataclass(frozen=True)
class Logs(Recordings):
    """Logs as Argoverse 2 has them, of which an option leaves some out."""

    split: str = ""

    def scenes(self):
        return [log.name for log in logs(self.folder) if log.name.startswith(self.split)]

    def film(self, scene):
        return argoverse2_film(self.folder / scene)

    def files(self, scene):
        return sorted((self.folder / scene).iterdir())
'''
SHORT = ["--budgets", "0.05", "--floor-seeds", "1", "--policies", "random", "--workers", "1"]


@pytest.fixture
def installed(install):
    install("crossings", CROSSINGS, SOURCES.group, crossings="Crossings")
    install("own_logs", LOGS, SOURCES.group, ownlogs="Logs")


def run(*arguments):
    with pytest.raises(SystemExit) as end:
        main([*map(str, arguments)])
    return end.value.code


def test_the_protocol_plays_it_and_names_it(installed, tmp_path, capsys):
    command = ["protocol", "--source", "crossings", "--scenes", "2", *SHORT]
    assert run(*command, "--out", tmp_path / "out") == 0
    rows = read_results(tmp_path / "out")[0]
    told = [(row["source"], row["scene"]) for row in rows]
    assert told == [("crossings", "crossings-0000"), ("crossings", "crossings-0001")]
    # Asked again, they are found: the worker's digests are those of this process.
    assert run(*command, "--out", tmp_path / "out") == 0
    assert "2 of 2 plays found" in capsys.readouterr().err


def test_the_documented_source_of_boxes_plays_from_fifteen_lines(tmp_path, monkeypatch, capsys):
    (mine,) = (one for one in fenced(ROOT / "docs" / "protocol.md", "python") if "Mine" in one)
    source = mine.partition('if __name__ == "__main__":')[0]
    assert len([line for line in source.splitlines() if line.strip()]) <= 15
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "mine.py").write_text(mine)
    exec(compile(mine, "mine.py", "exec"), {"__name__": "__main__"})
    annotated, speed = capsys.readouterr().out.rsplit(maxsplit=1)
    assert (annotated.count("2") >= 4, float(speed)) == (True, pytest.approx(8.0))
    assert run("protocol", "--source", "mine:Mine:drives", *SHORT, "--out", tmp_path / "out") == 0
    (row,) = read_results(tmp_path / "out")[0]
    assert (row["source"], row["scene"], row["keyframes"]) == ("mine:Mine", "monday", 8)
    assert row["events"] == 1.0
    # Its field `sensor` is an option, the grid of its films and a column of its rows.
    mounted = source_of("mine:Mine:drives", sensor="os1-64")
    (scene,) = mounted.scenes()
    assert len(mounted.film(scene).grid.elevations) == 64
    assert mounted.row(scene)["sensor"] == "os1-64"


def test_recordings_are_asked_for_with_their_folder_and_options(installed, drive):
    source = source_of(f"ownlogs:{drive.parent}", split="dr")
    (scene,) = source.scenes()
    row = source.row(scene)
    ours = source_of(f"argoverse2:{drive.parent}")
    assert row["source"] == "ownlogs"
    assert len(row["recording"]) == len(ours.row(scene)["recording"])
    assert len(source.film(scene).shots) == len(ours.film(scene).shots)
    with pytest.raises(InvalidInput, match="ownlogs: sweeps has no meaning for ownlogs recordings"):
        source_of(f"ownlogs:{drive.parent}", sweeps=2)


def test_gymnasium_replays_both(installed, drive):
    for source, scene in (("crossings", "crossings-0002"), (f"ownlogs:{drive.parent}", "drive")):
        env = gymnasium.make("CARE-Replay-v0", source=source, scene=scene)
        env.reset(seed=0)
        assert env.unwrapped.loop.film.name == scene
        env.close()
    with pytest.raises(InvalidInput, match="source crossings: unknown scene 'crossings-0099'"):
        gymnasium.make("CARE-Replay-v0", source="crossings", scene="crossings-0099")


def digest_of(source):
    return PlayConfig(source, source.scenes()[0], "random").digest()


def test_an_edit_of_its_code_and_an_option_make_its_plays_others(installed, drive, monkeypatch):
    whole, some = (digest_of(source_of(f"ownlogs:{drive.parent}", split=s)) for s in ("", "d"))
    assert whole != some
    monkeypatch.setattr("care_sim.study.provenance._entry_digest", lambda _entry: "edited")
    assert digest_of(source_of(f"ownlogs:{drive.parent}", split="d")) != some


BROKEN = """
from dataclasses import dataclass
from care_sim.sources.recordings import Recordings
from care_sim.sources.scenes import Generated

module = "a string"

class Other: ...

@dataclass(frozen=True)
class Abstract(Generated):
    def seeds(self): ...

class Plain(Abstract):
    rate: float = 3.0
    def street(self, seed): ...

@dataclass(frozen=True)
class Sound(Generated):
    def seeds(self):
        return range(2)
    def street(self, seed):
        return "a street"

@dataclass(frozen=True)
class Exploding(Sound):
    def street(self, seed):
        raise KeyError("lane")

@dataclass(frozen=True)
class Twice(Sound):
    def name(self, seed):
        return "same"

@dataclass(frozen=True)
class Refusing(Sound):
    def __post_init__(self):
        raise RuntimeError("today")

@dataclass(frozen=True)
class Filmless(Recordings):
    def scenes(self):
        return ["one"]
    def film(self, scene): ...
    def files(self, scene):
        return [self.folder / "one"]
"""
UNLOADED = {
    "string": ("module", "broken_sources:module is neither Recordings nor Generated"),
    "other": ("Other", "broken_sources:Other is neither Recordings nor Generated"),
    "abstract": ("Abstract", "broken_sources:Abstract is abstract: it lacks street"),
    "plain": ("Plain", "broken_sources:Plain is no dataclass"),
    "torn": ("Nowhere", "AttributeError: .*Nowhere"),
}
UNPLAYED = {
    "sound": ("Sound", "source sound: street must return a Street, got str"),
    "exploding": (
        "Exploding",
        "source exploding makes no film of exploding-0000: KeyError: 'lane'",
    ),
    "twice": ("Twice", "source twice: scenes must be names, at least one and each once"),
    "refusing": ("Refusing", "source refusing refuses to start: RuntimeError: today"),
    "filmless:.": ("Filmless", "source filmless: film must return a Film, got NoneType"),
    "filmless": ("Filmless", "source filmless: its recordings lie in a folder: .* filmless:FOLDER"),
    "sound:folder": ("Sound", "source sound: it is generated and has no folder, got 'folder'"),
}


@pytest.fixture
def broken(install):
    names = {name.partition(":")[0]: thing for name, (thing, _) in (UNLOADED | UNPLAYED).items()}
    install("broken_sources", BROKEN, SOURCES.group, **names)


@pytest.mark.parametrize("name", UNLOADED)
def test_one_that_cannot_be_loaded_is_named_with_the_reason(broken, name):
    with pytest.raises(InvalidInput, match=f"source {name} cannot be loaded: {UNLOADED[name][1]}"):
        source_of(name)


@pytest.mark.parametrize("name", UNPLAYED)
def test_one_that_makes_no_film_is_named_with_the_reason(broken, name):
    with pytest.raises(InvalidInput, match=UNPLAYED[name][1]):
        _ = (source := source_of(name)).film(source.scenes()[0])


def test_commands_say_it_in_one_line(broken, installed, tmp_path, capsys):
    played = ["protocol", *SHORT, "--out", tmp_path / "out", "--source"]
    for source, told in (
        ("torn", "source torn cannot be loaded: AttributeError"),
        ("exploding", "failed: exploding-0001 random 0.05: source exploding makes no film"),
        ("moon", "unknown source 'moon'; known: streets, argoverse2:FOLDER, nuscenes:FOLDER, "),
        ("nuscene:data", "unknown source 'nuscene:data'; known: streets"),
        ("crossings:Nowhere", "source crossings: it is generated and has no folder"),
    ):
        assert run(*played, source) in (1, 2)
        error = capsys.readouterr().err
        assert told in error
        assert "Traceback" not in error
