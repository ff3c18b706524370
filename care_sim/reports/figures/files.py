"""Files of figures: written as PNG and SVG, removed when another study takes their folder."""

import warnings
from collections.abc import Container, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from matplotlib import rc_context, rcdefaults
from matplotlib.axis import Tick
from matplotlib.figure import Figure
from matplotlib.text import Text

from care_sim.base.errors import printable, printable_lines
from care_sim.base.files import PNG, SVG, check_output, replacing

FORMATS = (".png", ".svg")
"""Endings of the two files of a figure."""


@contextmanager
def default_style() -> Iterator[None]:
    """Draw with Matplotlib's own defaults, whatever the user's settings are. Every function that
    makes a figure runs within it.
    """
    with rc_context():
        rcdefaults()
        yield


def save(figure: Figure, stem: Path) -> None:
    """Write a figure as PNG and SVG, with its texts as they are."""
    with default_style(), texts_as_they_are(figure):
        with replacing(stem.with_suffix(".png")) as unfinished:
            figure.savefig(unfinished, dpi=200)
        # Ids within an SVG are random without a salt, and it holds the date. Neither may make a new
        # file of the same figure.
        with (
            rc_context({"svg.hashsalt": printable(stem.name)}),
            replacing(stem.with_suffix(".svg")) as unfinished,
        ):
            figure.savefig(unfinished, metadata={"Date": None})


@contextmanager
def texts_as_they_are(figure: Figure) -> Iterator[None]:
    """Within it the figure can be drawn with any texts: a $ in a name begins no formula, control
    codes are shown as escapes, and what the font has no sign for is drawn as a box.
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


def check_figure(stem: Path) -> None:
    """Raise what `care_sim.base.files.check_output` does where `save` could not write a figure."""
    check_output(stem.with_suffix(".png"), PNG)
    check_output(stem.with_suffix(".svg"), SVG)


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
