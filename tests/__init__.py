"""Tests, which mirror the rooms of the package."""
