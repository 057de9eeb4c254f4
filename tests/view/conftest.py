from __future__ import annotations

import numpy as np
import pytest

from dynresp.motion import rotations
from dynresp.view.story import MovingCapsule, Story
from tests.view.samples import story_of, striding


@pytest.fixture
def story() -> Story:
    return story_of(striding(30, 1.3))


@pytest.fixture
def crowded_story() -> Story:
    """With a second character, who holds still at the end, and the arm that hits."""
    motion = striding(30, 0.0)
    other = striding(20, 0.0).moved(np.pi, (0.8, 0.4, 0.0))
    arm = MovingCapsule(
        "arm",
        0.04,
        0.2,
        motion.root_positions[:25] + np.array([0.5, 0.2, 0.4]),
        np.tile(rotations.about_axis((0, 1, 0), 1.2), (25, 1)),
    )
    return story_of(motion, others=[other], capsules=[arm], spheres=[])
