"""The campaigns by name, and what share of the time each has."""

import importlib

from tests.torture.case import FOUND, Name

CAMPAIGNS = {
    "commands": 4,
    "shell": 2,
    "calls": 3,
    "files": 2,
    "recordings": 2,
    "journals": 1,
    "kills": 4,
    "writers": 1,
    "disk": 2,
    "folders": 2,
    "environment": 2,
    "limits": 2,
}


def found(campaign):
    """The cases of a campaign that once went wrong."""
    count = len(getattr(importlib.import_module(f"tests.torture.{campaign}"), "FOUND_CASES", ()))
    return [Name(campaign, FOUND, number) for number in range(count)]
