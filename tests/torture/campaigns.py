"""The campaigns by name, and what share of the time each has."""

CAMPAIGNS = {"commands": 4, "calls": 3, "files": 3, "journals": 1, "kills": 4, "writers": 1, "disk": 2}
