"""Bodies of people that are filmed in tests."""

from pathlib import Path

from dynresp.motion.character import Character
from studies.video.people import PEOPLE


def person(name: str, folder: Path) -> Character:
    """The character with a person's shape."""
    bodies = {known.name: known.body for known in PEOPLE}
    return bodies[name].character(folder)
