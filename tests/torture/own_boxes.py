"""A source of one's own, `tests.torture.own_boxes:Boxes`: its films are what a file says."""

import json
from dataclasses import dataclass, replace

import numpy as np

import care_sim
from care_sim.sources.recordings import Recordings


@dataclass(frozen=True)
class Boxes(Recordings):
    """One film of boxes per JSON file; `spoilt` in it says what becomes of the film."""

    def scenes(self):
        return sorted(path.stem for path in self.folder.glob("*.json"))

    def film(self, scene):
        try:
            drive = json.loads((self.folder / f"{scene}.json").read_text())
            told = drive["times_s"], drive["ego"], drive["boxes"]
        except (OSError, ValueError, TypeError, LookupError, RecursionError) as error:
            raise care_sim.InvalidInput(f"{scene}.json holds no drive") from error
        film = care_sim.film_of_boxes(scene, *told)
        for part, field, at, value in drive.get("spoilt", ()):
            film = spoilt_film(film, part, field, at, value)
        return film


def spoilt_film(film, part, field, at, value):
    """The film with another value in a field of a part of its second shot."""
    shot = film.shots[1]
    if part == "shots":
        return replace(film, shots=film.shots[:at])
    if part == "shot":
        return _with(film, replace(shot, **{field: value}))
    whole = getattr(shot, part)
    changed = value
    if isinstance(getattr(whole, field), np.ndarray):
        changed = getattr(whole, field).astype(float)
        changed.flat[at % max(changed.size, 1)] = value
        if field in ("objects", "classes", "cells") and np.isfinite(changed).all():
            changed = changed.astype(np.int64)
    return _with(film, replace(shot, **{part: replace(whole, **{field: changed})}))


def _with(film, shot):
    return replace(film, shots=(film.shots[0], shot, *film.shots[2:]))
