"""The line with which every learner ends."""

import shlex


def how_to_play(*words: object) -> str:
    """The command that plays what was learned."""
    return f"play it: {shlex.join(['care-sim', *map(str, words)])}"
