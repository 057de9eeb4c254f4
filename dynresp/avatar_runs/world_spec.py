"""World files: boxes on level ground that avatars walk around (`docs/worlds.md`)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from dynresp.locomotion.worlds.obstacles import MAX_BOXES, Obstacle, World
from dynresp.specs.shared_tables import Strict
from dynresp.specs.toml_errors import Hints, read_spec
from dynresp.specs.values import fixed, shown
from dynresp.support.errors import SpecError, UsageError


def _numbers(count: int, unit: str) -> BeforeValidator:
    """For a field that is a list of `count` finite numbers."""

    def check(given: Any) -> tuple[float, ...]:
        right = isinstance(given, list | tuple) and len(given) == count
        if not right or not all(
            isinstance(x, int | float) and not isinstance(x, bool) and abs(x) <= 1e5 for x in given
        ):
            raise ValueError(f"expected {count} numbers in brackets {unit}, got {shown(given)}")
        return tuple(float(x) for x in given)

    return BeforeValidator(check)


class WorldTable(Strict):
    """`[world]`: the bounds of the ground."""

    bounds: Annotated[tuple[float, float, float, float], _numbers(4, "(x, y, x, y) [m]")]


class BoxTable(Strict):
    """`[[box]]`: a box that stands on the ground."""

    center: Annotated[tuple[float, float], _numbers(2, "(x, y) [m]")]
    size: Annotated[tuple[float, float], _numbers(2, "(along x, along y) [m]")]
    turn_deg: Annotated[float, fixed(-360.0, 360.0, "degrees")] = 0.0
    height_m: Annotated[float, fixed(0.01, 100.0, "m")] = 2.0


class WorldFile(Strict):
    """A whole file."""

    world: WorldTable
    box: Annotated[list[BoxTable], Field(default_factory=list, max_length=MAX_BOXES)]


_HINTS = Hints(missing={"world": "add [world] with bounds"})


def read_world(path: Path | str) -> World:
    """Read a world file.

    Args:
        path: A TOML file.

    Raises:
        SpecError: It cannot be read, is too large or not TOML, or says something that is not
            allowed. The message names the file, the key, what was given and what is allowed.
    """
    spec = read_spec(WorldFile, Path(path), "a world file", _HINTS)
    try:
        boxes = [
            Obstacle(
                box.center,
                (0.5 * box.size[0], 0.5 * box.size[1]),
                math.radians(box.turn_deg),
                box.height_m,
            )
            for box in spec.box
        ]
        return World(spec.world.bounds, tuple(boxes))
    except UsageError as error:
        raise SpecError(f"{path}: {error}") from None
