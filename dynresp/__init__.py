"""dynresp: a character that takes a hit and goes on moving like a person.

The names listed in `__all__` are the stable Python interface. Everything else is private and may
change with any version.

Examples:
    >>> import dynresp
    >>> ball = dynresp.Ball(time=1.5, mass=6, speed=8, from_deg=180)
    >>> response = dynresp.hit("builtin:walk", ball, library="builtin")
    >>> response.poses.shape[1]
    59
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dynresp.experiments.one_hit import HitResponse as HitResponse
    from dynresp.experiments.one_hit import hit as hit
    from dynresp.front_door import ExperimentResult as ExperimentResult
    from dynresp.front_door import build_graph as build_graph
    from dynresp.front_door import load_motion as load_motion
    from dynresp.front_door import run as run
    from dynresp.locomotion.avatar.avatar import Avatar as Avatar
    from dynresp.locomotion.avatar.avatar_crowd import AvatarCrowd as AvatarCrowd
    from dynresp.locomotion.graph.motion_graph import MotionGraph as MotionGraph
    from dynresp.motion.character import Character as Character
    from dynresp.motion.motion import Motion as Motion
    from dynresp.motion.reactions.reaction_library import ReactionLibrary as ReactionLibrary
    from dynresp.motion.reactions.reaction_library import load_library as load_library
    from dynresp.physics.impacts import Ball as Ball
    from dynresp.physics.impacts import Punch as Punch
    from dynresp.physics.impacts import Push as Push
    from dynresp.physics.impacts import Strike as Strike
    from dynresp.response.runtime.crowd import Crowd as Crowd
    from dynresp.support.errors import DynrespError as DynrespError
    from dynresp.support.errors import MissingMotionDataError as MissingMotionDataError
    from dynresp.support.errors import MotionFileError as MotionFileError
    from dynresp.support.errors import SimulationError as SimulationError
    from dynresp.support.errors import SpecError as SpecError
    from dynresp.support.errors import UsageError as UsageError

__version__ = "0.1.0"

# Where each name is defined. It is imported when it is first used, so that `import dynresp` is
# light.
_HOMES = {
    "Avatar": "dynresp.locomotion.avatar.avatar",
    "AvatarCrowd": "dynresp.locomotion.avatar.avatar_crowd",
    "Ball": "dynresp.physics.impacts",
    "Character": "dynresp.motion.character",
    "Crowd": "dynresp.response.runtime.crowd",
    "DynrespError": "dynresp.support.errors",
    "ExperimentResult": "dynresp.front_door",
    "HitResponse": "dynresp.experiments.one_hit",
    "MissingMotionDataError": "dynresp.support.errors",
    "Motion": "dynresp.motion.motion",
    "MotionFileError": "dynresp.support.errors",
    "MotionGraph": "dynresp.locomotion.graph.motion_graph",
    "Punch": "dynresp.physics.impacts",
    "Push": "dynresp.physics.impacts",
    "ReactionLibrary": "dynresp.motion.reactions.reaction_library",
    "SimulationError": "dynresp.support.errors",
    "SpecError": "dynresp.support.errors",
    "Strike": "dynresp.physics.impacts",
    "UsageError": "dynresp.support.errors",
    "build_graph": "dynresp.front_door",
    "hit": "dynresp.experiments.one_hit",
    "load_library": "dynresp.motion.reactions.reaction_library",
    "load_motion": "dynresp.front_door",
    "run": "dynresp.front_door",
}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    """Import a name of the interface when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"module 'dynresp' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The names of the interface."""
    return sorted(__all__)
