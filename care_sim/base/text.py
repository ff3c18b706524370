"""Text made fit to be shown: on one line, not too long, without what a terminal would obey."""

_QUOTED = 120
"""Characters of a value that a message quotes."""


def printable(text: str) -> str:
    """The text with what a terminal or a file would obey rather than show (control codes,
    directions, halves of characters) written as escapes.
    """
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in text
    )


def percent(budget: float) -> str:
    """A budget as people read it."""
    return f"{100 * budget:.3g}%"


def counted(count: int, unit: str) -> str:
    """A number of things, as a sentence says it."""
    return f"{count:,} {unit}{'' if count == 1 else 's'}"


def one_line(text: str) -> str:
    """The text on one line; what a terminal would not show is written as escapes."""
    return printable(" ".join(text.split()))


def shown(value: object) -> str:
    """A value as a message quotes it: on one line, its middle left out where it is long."""
    try:
        text = one_line(repr(value))
    except Exception:  # whatever a foreign object does; an int of 4,300 digits refuses, too
        text = f"{'an' if isinstance(value, int) else 'a value of type'} {type(value).__name__}"
    return shortened(text, _QUOTED)


def shortened(text: str, most: int) -> str:
    """The text, its middle left out where it is longer than `most` characters."""
    return text if len(text) <= most else f"{text[: most - 20]}...{text[-17:]}"


def error_line(error: BaseException) -> str:
    """The type of an error and what it says, on one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
