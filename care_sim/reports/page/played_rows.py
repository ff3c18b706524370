"""Configurations from rows: of an episode, or of a play of the open loop."""

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import OF_BOTH_LOOPS
from care_sim.envs.open_loop import UNFILMED
from care_sim.sensors.setups import setup_of_columns
from care_sim.sources.feeding import with_sweeps
from care_sim.sources.installed import RECORDING_KINDS
from care_sim.sources.named import source_of
from care_sim.sources.scenes import SPLITS, Scene, Source, Streets
from care_sim.study.episode_config import PLAIN_FIELDS, EpisodeConfig
from care_sim.study.play_config import PlayConfig
from care_sim.study.rows.parameters import Parameters
from care_sim.study.run_config import Row


def in_open_loop(row: Row) -> bool:
    """Whether a row is of a play in a scene of a source."""
    return "scene" in row


def config_of(row: Row) -> EpisodeConfig:
    """The configuration that a row was played with. Raises InvalidInput for one that this version
    does not accept, and for a sensor set-up that is neither told nor comes with it.
    """
    # A condition that the file's version did not know, or the row does not tell, is the default.
    plain = {name: row[name] for name in PLAIN_FIELDS if row.get(name) is not None}
    for name in ("detector", "keyframe_s"):
        if row.get(name) is not None:
            plain[name] = row[name]
    plain["sensor"] = setup_of_columns(row)
    for kind in ("detector", "scenario", "policy"):
        plain[f"{kind}_parameters"] = _parameters(row, kind)
    return EpisodeConfig(**plain)


def play_config_of(row: Row, source: Source | None) -> PlayConfig:
    """The same of a row of the open loop; `source` is where its scene is found, None for one that
    the row names. Raises InvalidInput, too, where the scene is not found there, or is another.
    """
    own = _source(row) if source is None or source.kind != row["source"] else source
    # The row knows how many sweeps a detector asked for.
    if sweeps := row.get("sweeps"):
        own = with_sweeps(own, sweeps) or own
    scene = _scene(row, own)
    for name, value in own.row(scene).items():
        if row.get(name) != value:
            told = f"{name} {value}, in the results {row.get(name) or 'none'}"
            raise InvalidInput(f"the scene {scene.name} is another here: {told}")
    fields = [name for name in OF_BOTH_LOOPS if name not in UNFILMED]
    names = ("policy", "budget", "detector", "presence", *fields)
    plain = {name: row[name] for name in names if row.get(name) is not None}
    for kind in ("detector", "policy"):
        plain[f"{kind}_parameters"] = _parameters(row, kind)
    return PlayConfig(own, scene, **plain)


def _source(row: Row) -> Source:
    kind = row["source"]
    if kind == Streets.kind:
        return _streets(row)
    if kind in RECORDING_KINDS or row.get("recording") is not None:
        raise InvalidInput(f"their recordings are not at hand: --source {kind}:FOLDER")
    return source_of(kind)


def _streets(row: Row) -> Streets:
    of_splits = [Streets(split, sensor=setup_of_columns(row)) for split in SPLITS]
    named = (one for one in of_splits if any(row["scene"] == each.name for each in one.scenes()))
    return next(named, of_splits[0])


def _scene(row: Row, source: Source) -> Scene:
    for scene in source.scenes():
        if scene.name == row["scene"]:
            return scene
    raise InvalidInput(f"{source.kind} holds no scene {row['scene']} here")


def _parameters(row: Row, kind: str) -> Parameters:
    named = (
        (name.removeprefix(f"{kind}."), value)
        for name, value in row.items()
        if name.startswith(f"{kind}.")
    )
    # A column holds nothing in the rows whose scenario or policy lacks the parameter.
    return tuple((name, value) for name, value in named if value is not None)
