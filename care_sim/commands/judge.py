"""`care-sim judge`: detectors against what is there."""

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import BrokenExecutor
from functools import partial
from typing import Any

import numpy as np

from care_sim.base.errors import InvalidInput, print_lines, report_problems
from care_sim.base.files import JSON, check_no_link, check_output, write_text
from care_sim.base.interrupts import DONE, FAILED
from care_sim.commands.options.results import Judge
from care_sim.commands.shared.console import TableConsole
from care_sim.commands.shared.selection import check_values, common_of, source_named
from care_sim.evaluation.detector_quality import SceneBoxes, counts, curve, reliability
from care_sim.perception.detectors import PROXY, check_detector
from care_sim.policies.isolation import isolated_policies
from care_sim.reports.detectors import Judged, detector_tables
from care_sim.reports.figures.detectors import DETECTORS_FIGURE, detectors_figure
from care_sim.reports.figures.styles import check_figure, save
from care_sim.sources.feeding import source_for
from care_sim.sources.scenes import Scene, Source, chosen_scenes
from care_sim.study.episode_play import result_or_reason
from care_sim.study.executors import processes
from care_sim.study.judging import JudgedScene, judge_scene
from care_sim.study.play_config import PlayConfig, play_grid
from care_sim.study.progress import shown_progress
from care_sim.study.provenance import machine, versions
from care_sim.study.rows.parameters import Parameters, parameters
from care_sim.study.runner import DIED

_FIGURES = "judge.json"
_TABLES = "tables.md"
_OFFICIAL = "official"
_TRUTH = "truth"


@isolated_policies()
def judge(options: Judge) -> int:
    """Judge the detectors, print tables and write them."""
    check_values(options, "detectors", "least_scores")
    for name in (options.against, *options.detectors):
        check_detector(name)
    if options.detector != PROXY:
        raise InvalidInput("judge takes --detectors, one or several, instead of --detector")
    names = [*dict.fromkeys(options.detectors)]
    source = source_named(options, options.source)
    scenes = chosen_scenes(source.scenes(), options.scenes)
    plays = _plays(options, names, source, scenes)
    _check_folder(options)
    judged: dict[str, dict[str, JudgedScene]] = {name: {} for name in names}
    problems = []
    # Print finished judgements, whatever ends the command.
    try:
        with (
            processes(options.workers) as pool,
            shown_progress(len(plays), "scenes") as show,
        ):
            found = pool.map(partial(result_or_reason, judge_scene), plays)
            for number, (scene, each) in enumerate(zip(scenes, found, strict=True), 1):
                if isinstance(each, str):
                    problems.append(f"failed: {scene.name}: {each}")
                else:
                    for name, one in zip(names, each, strict=True):
                        judged[name][scene.name] = one
                show(number, "")
    except BrokenExecutor:
        problems.append(f"{DIED} that judges")
    finally:
        if judged[names[0]]:
            _tell(options, judged, plays[0])
    report_problems(problems)
    return FAILED if problems else DONE


def _check_folder(options: Judge) -> None:
    """Raise InvalidInput where a file could not be written, or would be lost."""
    if (options.out / _FIGURES).exists() and not options.force:
        raise InvalidInput(
            f"{options.out} holds what was judged before: give another --out, or --force to "
            "replace it"
        )
    check_no_link(options.out / _OFFICIAL)
    check_output(options.out / _FIGURES, JSON)
    check_output(options.out / _TABLES)
    check_figure(options.out / DETECTORS_FIGURE)


def _plays(
    options: Judge, names: Sequence[str], source: Source, scenes: Sequence[Scene]
) -> list[list[PlayConfig]]:
    """Return the plays of every scene, one per detector."""
    common = common_of(options, [options.policy])
    floors = [common.pop("floor_seed")]
    made = []
    for name in names:
        given = _parameters(options, name)
        own = common | {"detector": name, "detector_parameters": given}
        fed = source_for(source, name, given, options.sweeps)
        plays = play_grid(fed, scenes, [options.policy], [options.budget], floors, **own)
        plays[0].try_out()
        made.append(plays)
    return [list(plays) for plays in zip(*made, strict=True)]


def _parameters(options: Judge, detector: str) -> Parameters:
    given = parameters(options.detector_parameters)
    # A detector may be named by its place, which has dots, too.
    owners = {name: name.rpartition(".")[0] for name, _ in given}
    if foreign := [name for name, owner in owners.items() if owner not in options.detectors]:
        raise InvalidInput(
            f"detector parameters are given as DETECTOR.NAME=VALUE of one of "
            f"{', '.join(options.detectors)}, got {foreign[0]}"
        )
    return tuple(
        (name.rpartition(".")[2], value) for name, value in given if owners[name] == detector
    )


def _tell(
    options: Judge,
    judged: Mapping[str, Mapping[str, JudgedScene]],
    plays: Sequence[PlayConfig],
) -> None:
    """Write tables, figure and numbers, and with --official all boxes; print the tables. `plays`
    are those of one scene.
    """
    scenes = {name: [*own.values()] for name, own in judged.items()}
    first = next(iter(judged.values()))
    tables = detector_tables(scenes, options.least_scores, options.against)
    told = _report(options, [*first], scenes, plays)
    write_text(options.out / _FIGURES, json.dumps(told, indent=1) + "\n")
    write_text(options.out / _TABLES, "\n".join(table.markdown() for table in tables))
    save(detectors_figure(told["detectors"]), options.out / DETECTORS_FIGURE)
    # Samples of another run beside these would be scored as if they were of these scenes.
    official = options.out / _OFFICIAL
    for old in official.glob("*.json"):
        old.unlink()
    if options.official:
        written = {name: [one.reported for one in own] for name, own in scenes.items()}
        for name, samples in (written | {_TRUTH: [one.true for one in first.values()]}).items():
            all_boxes = {token: own for each in samples for token, own in each.items()}
            write_text(official / f"{name}.json", json.dumps(all_boxes))
    for table in tables:
        TableConsole().print(table.rich())
    figure = f"Figure: {options.out / DETECTORS_FIGURE}.png"
    print_lines(f"Tables: {options.out / _TABLES}", figure)


def _report(
    options: Judge, names: Sequence[str], judged: Judged, plays: Sequence[PlayConfig]
) -> dict[str, Any]:
    """Everything that the tables and the figure show, and what was played, as plain values."""
    rows = {play.detector: play.row() for play in plays}
    row = rows[plays[0].detector]
    # A detector may be fed other sweeps than another, which are other files of the recording.
    shared = {n for n in row if all(other.get(n) == row[n] for other in rows.values())}
    return {
        "scenes": [*names],
        "conditions": {
            n: row[n] for n in row if n in shared and not n.startswith(("scene", "detector"))
        },
        "detector_parameters": [list(pair) for pair in parameters(options.detector_parameters)],
        "least_scores": list(options.least_scores),
        "versions": versions(),
        "machine": machine(),
        "detectors": {
            name: _numbers(options, [one.boxes for one in own])
            | {"scan_ms": float(np.median(np.concatenate([one.scan_ms for one in own])))}
            | {"sweeps": rows[name].get("sweeps", 1)}
            for name, own in judged.items()
        },
    }


def _numbers(options: Judge, scenes: Sequence[SceneBoxes]) -> dict[str, Any]:
    columns = ("boxes", "right", "frames", "found", "events", "sighted")
    met = {score: counts(scenes, score) for score in (0.0, *options.least_scores)}
    return {
        "from score": {
            f"{score:g}": {name: float(getattr(found, name).sum()) for name in columns}
            for score, found in met.items()
        },
        "score, recall, precision": curve(scenes).round(5).tolist(),
        "boxes, mean score, share right": [
            [None if np.isnan(number) else round(number, 5) for number in row]
            for row in reliability(scenes).tolist()
        ],
    }
