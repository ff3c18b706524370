"""The errors that led to an error."""

from collections.abc import Iterator


def causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error, the error that led to it, and so on, as Python's trace shows them.

    An error raised `from None` has no cause. Each error comes once: code that raises an error again
    while it handles another one may close a circle.
    """
    known: set[int] = set()
    while error is not None and id(error) not in known:
        known.add(id(error))
        yield error
        is_hidden = error.__cause__ is not None or error.__suppress_context__
        error = error.__cause__ if is_hidden else error.__context__
