"""The one style of all figures: readable on a light and on a dark page, on a transparent ground."""

import re
import warnings
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from io import StringIO
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context, rcdefaults, rcParams
from matplotlib.axes import Axes
from matplotlib.axis import Tick
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text

from care_sim.base.errors import printable, printable_lines
from care_sim.base.files import PNG, SVG, check_output, replacing

_NAME_POINTS = 8
_LINE_SPACING = 1.15
_INCH_POINTS = 72


def name_ends(figure: Figure, ends: Mapping[Axes, Mapping[str, tuple[float, str]]]) -> None:
    """Name curves right of their axes, each at the height of its right end and in its colour; names
    that would overlap move up or down. The figure keeps the layout that it has then.
    """
    names = {axes: [*map(partial(_name, axes), own, own.values())] for axes, own in ends.items()}
    # Heights on paper are known once the names have taken their room.
    with allow_any_text(figure):
        figure.draw_without_rendering()
    figure.set_layout_engine("none")
    points = _INCH_POINTS / figure.dpi
    for axes, own in names.items():
        heights = {name: axes.transData.transform(name.xy)[1] * points for name in own}
        upwards = sorted(own, key=lambda name: heights[name])
        box = axes.get_window_extent()
        least = _LINE_SPACING * _NAME_POINTS
        moved = apart([heights[name] for name in upwards], least, box.y0 * points, box.y1 * points)
        for name, place in zip(upwards, moved, strict=True):
            name.set_position((4, place - heights[name]))


def _name(axes: Axes, name: str, end: tuple[float, str]) -> Annotation:
    height, colour = end
    look: dict[str, Any] = {"va": "center", "size": _NAME_POINTS, "color": colour}
    look |= {"xycoords": axes.get_yaxis_transform(), "textcoords": "offset points"}
    return axes.annotate(name, (1.0, height), (4, 0), annotation_clip=False, **look)


def apart(heights: Sequence[float], least: float, low: float, high: float) -> list[float]:
    """Ascending heights, moved as little as can be so that each is at least `least` above the one
    before and all are between `low` and `high`, where there is room.
    """
    from scipy.optimize import isotonic_regression

    steps = least * np.arange(len(heights))
    moved = isotonic_regression(np.array(heights) - steps).x + steps
    moved = np.maximum(moved, low + steps)
    # The highest stays below the top, and those below it have room for the ones above.
    return [float(place) for place in np.minimum(moved, high - steps[::-1])]


INK = "#757575"
"""Colour of texts and axes: a grey with a contrast of 4.5 to both white and black."""
CALM = "#999999"
"""Colour of background curves."""
BLUE, ORANGE, GREEN, YELLOW = "#0072B2", "#D55E00", "#00946B", "#C28100"
"""From the palette of Okabe and Ito (2008), safe for the colour-blind; two are darkened, so that
names in these colours are read on white, too.
"""
STYLE: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": INK,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.labelcolor": INK,
    "axes.labelsize": 9,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 9,
    "figure.titlesize": 10,
    "grid.alpha": 0.25,
    "grid.color": INK,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "legend.labelcolor": INK,
    # Texts of an SVG stay texts: they can be searched, and take a third of the space.
    "svg.fonttype": "none",
    "text.color": INK,
    "xtick.color": INK,
    "xtick.labelsize": 8,
    "ytick.color": INK,
    "ytick.labelsize": 8,
}
"""Settings of Matplotlib in which every figure departs from the defaults."""
_COLOURS = {
    "full": INK,
    "full scan": INK,
    "best control": "#8F6A4E",
    "history": YELLOW,
    "all-camera": ORANGE,
    "care": BLUE,
    "care-sbf": GREEN,
    "care-priority": "#3B93C4",
    "care-sightlines": "#9B59D0",
    "care-spread": "#5B82C2",
    "care-sector": "#C2478A",
    "care-aimed": "#D9622B",
    "boxes": "#B3543C",
    "tuned-place": "#1FA2A6",
    "after-ancha": "#7A7A3C",
    "uncertainty": "#B5679A",
    "history-uniform": "#A8506F",
    "beam-reduce": "#7468C0",
    "random": "#8A8A22",
    "rows": "#C05A6B",
    "place": "#2E9587",
    "place-hulls": "#B45565",
    "fan": "#96862A",
    "learned-scorer": "#2E8B4A",
    "learned-sets": "#3C8F3C",
    "ppo": "#AF5BAF",
    "ppo-dartout": "#B3543C",
}
_SPARE = (GREEN, "#7468C0", "#C2478A", "#96862A", "#2E9587", "#B3543C", "#3B93C4", "#8A8A22")


def colours(policies: Iterable[str]) -> dict[str, str]:
    """The colour of every policy, the same in every figure."""
    # Other policies get unused colours, in their order; so the same study has the same colours.
    known = {policy: _COLOURS.get(policy) for policy in policies}
    spare = cycle([hue for hue in _SPARE if hue not in known.values()])
    return {policy: hue or next(spare) for policy, hue in known.items()}


FORMATS = (".png", ".svg")
"""Endings of the two files of a figure."""
_NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))
_UNUSED_ID = re.compile(r' id="[A-Za-z0-9_.]+_\d+"')
"""Matplotlib counts its groups anew in every figure, and nothing refers to them."""


@contextmanager
def default_style() -> Iterator[None]:
    """Draw in the style of the project, whatever the user's settings are. Every function that makes
    a figure runs within it.
    """
    with rc_context():
        rcdefaults()
        rcParams.update(STYLE)
        yield


def save(figure: Figure, stem: Path) -> None:
    """Write a figure as PNG, on white, and as SVG, on a transparent ground, with its texts as they
    are.
    """
    drawing = svg_text(figure, stem.name)
    with default_style(), allow_any_text(figure):
        with replacing(stem.with_name(f"{stem.name}.png")) as unfinished:
            figure.savefig(unfinished, dpi=200)
        with replacing(stem.with_name(f"{stem.name}.svg")) as unfinished:
            unfinished.write_text(drawing, encoding="utf-8")


def svg_text(figure: Figure, name: str) -> str:
    """The SVG of a figure of this name, the same text for the same figure. Several of them can
    stand in one page.
    """
    drawn = StringIO()
    # Ids within an SVG are random without a salt.
    salt: dict[Any, Any] = {"svg.hashsalt": printable(name)}
    with default_style(), rc_context(salt), allow_any_text(figure):
        figure.savefig(drawn, format="svg", transparent=True, metadata=_NO_METADATA)
    return _UNUSED_ID.sub("", drawn.getvalue())


@contextmanager
def allow_any_text(figure: Figure) -> Iterator[None]:
    """Draw figures with any texts within the block. A $ in a name begins no formula, control codes
    become escapes, and unknown characters become boxes.
    """
    # Labels of ticks are Matplotlib's own, and powers of ten among them are formulas.
    of_ticks = {id(label) for tick in figure.findobj(Tick) for label in tick.findobj(Text)}
    for text in figure.findobj(Text):
        if id(text) not in of_ticks:
            text.set_parse_math(False)
            text.set_text(printable_lines(text.get_text()))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph .* missing from font")
        yield


def stem_of(path: Path) -> Path:
    """The path of a figure without the ending of one of its files, if it has one."""
    return path.with_suffix("") if path.suffix in FORMATS else path


def check_figure(stem: Path) -> None:
    """Raise what `care_sim.base.files.check_output` does where `save` could not write a figure."""
    check_output(stem.with_name(f"{stem.name}.png"), PNG)
    check_output(stem.with_name(f"{stem.name}.svg"), SVG)


def remove_others(folder: Path, names: Iterable[str], kept: Container[str]) -> None:
    """Remove the figures of the given names from a folder, all but those `kept`; a * in a name
    stands for any text.
    """
    found = [
        path for name in names for suffix in FORMATS for path in folder.glob(f"{name}{suffix}")
    ]
    for path in found:
        if path.stem not in kept:
            path.unlink(missing_ok=True)
