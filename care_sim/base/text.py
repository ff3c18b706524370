"""Text of others, such as names of installed policies, made fit to be shown."""


def printable(text: str) -> str:
    """The text with what a terminal or a file would obey rather than show (control codes, directions, halves of
    characters) written as escapes.
    """
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in text)


def percent(budget: float) -> str:
    """A budget as people read it."""
    return f"{100 * budget:.3g}%"


def counted(count: int, unit: str) -> str:
    """A number of things, as a sentence says it."""
    return f"{count:,} {unit}{'' if count == 1 else 's'}"
