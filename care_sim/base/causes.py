"""The errors that led to an error."""

from collections.abc import Iterator


def causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error, what it was raised from, what that was raised from, and so on.

    Each error comes once: code that raises an error again while it handles another one may close a
    circle.
    """
    known: set[int] = set()
    while error is not None and id(error) not in known:
        known.add(id(error))
        yield error
        error = error.__cause__ or error.__context__
