"""The campaigns by name, and what share of the time each has."""

CAMPAIGNS = {"commands": 4, "calls": 4}
