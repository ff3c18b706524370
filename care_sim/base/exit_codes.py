"""The exit codes of commands."""

DONE = 0
FAILED = 1
"""Something failed, such as code of the user's own or a limit of the machine, or was left out."""
BAD_INPUT = 2
UNEXPECTED = 70
"""A fault in the software: `EX_SOFTWARE` of BSD."""
INTERRUPTED = 130
UNREAD = 141
"""Nobody reads the output: what a shell gives for SIGPIPE, 128 + 13."""
