"""Bodies of people who are filmed in tests."""

from pathlib import Path

from dynresp.motion.character import Character
from studies.video.people import PEOPLE


def person(name: str, folder: Path) -> Character:
    """The character of a person's shape."""
    bodies = {somebody.name: somebody.body for somebody in PEOPLE}
    return bodies[name].character(folder)
