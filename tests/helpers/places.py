"""Where the repository lies, or the sdist that holds these tests."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = ROOT / "results" / "data"
"""The folders of published rows; in a clone alone."""
