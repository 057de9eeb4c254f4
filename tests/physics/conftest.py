"""Scenes are compiled once."""

from collections.abc import Callable

import pytest

from dynresp.motion.character import Character
from dynresp.physics.scene import ImpactorKind, PhysicsConfig, Scene

SceneMaker = Callable[[ImpactorKind], Scene]


@pytest.fixture(scope="session")
def config() -> PhysicsConfig:
    """The default settings."""
    return PhysicsConfig()


@pytest.fixture(scope="session")
def scene_of(character: Character, config: PhysicsConfig) -> SceneMaker:
    """The scene of a kind of impact."""
    made: dict[ImpactorKind, Scene] = {}

    def get(kind: ImpactorKind) -> Scene:
        if kind not in made:
            made[kind] = Scene(character, kind, config)
        return made[kind]

    return get
