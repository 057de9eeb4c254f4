"""What all tests share: the character, a seeded generator, and real motion where there is some."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from dynresp.motion.character import Character, default_character

MOTIONS_VARIABLE = "DYNRESP_MOTIONS"

# The same examples on every run and machine; no deadline, since a first call loads and compiles.
settings.register_profile("dynresp", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("dynresp")


# A shell that starts the tests in the background makes them ignore control-C, and so every process
# that they start. The tests that send it want what a terminal gives.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _why_no_motions() -> str | None:
    given = os.environ.get(MOTIONS_VARIABLE, "")
    if not given:
        return f"{MOTIONS_VARIABLE} names no folder of real motion capture"
    if not Path(given).is_dir():
        return f"{MOTIONS_VARIABLE} is {given!r}, which is no folder"
    return None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip what needs real motion capture where there is none."""
    reason = _why_no_motions()
    if reason is not None:
        for item in items:
            if item.get_closest_marker("mocap"):
                item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session")
def motions_folder() -> Path:
    """The folder of real motion capture; tests that ask for it are marked `mocap`."""
    reason = _why_no_motions()
    if reason is not None:
        pytest.skip(reason)
    return Path(os.environ[MOTIONS_VARIABLE]).resolve()


@pytest.fixture(scope="session")
def character() -> Character:
    """The product's own character."""
    return default_character()


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed."""
    return np.random.default_rng(20070806)
