"""Settings of a motion graph."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from dynresp.support.checks import check_number
from dynresp.support.errors import UsageError


class Coordinates(Enum):
    """Coordinates in which frames are compared (Lee et al. 2002, section 4.1.2)."""

    RELATIVE = "relative"
    """Position on the ground and yaw are ignored: level ground, any direction."""
    FIXED = "fixed"
    """Positions in the world of the recording, where objects have fixed positions."""
    BLOCKS = "blocks"
    """A grid of blocks: whole blocks along and up, and quarter turns, are ignored."""


class Limits(NamedTuple):
    """The least and the largest value of a setting, and its unit in words."""

    low: float
    high: float
    unit: str = ""


LIMITS = {
    "fps": Limits(1.0, 240.0, "frames a second"),
    "sigma": Limits(1e-9, 1000.0),
    "least_probability": Limits(1e-9, 0.999),
    "velocity_weight": Limits(0.0, 100.0, "s^2"),
    "stutter_s": Limits(0.0, 10.0, "s"),
    "slip_m": Limits(0.0, 100.0, "m"),
    "blend_s": Limits(0.01, 10.0, "s"),
    "blend_rate_s": Limits(0.01, 10.0, "s"),
    "block_m": Limits(0.01, 100.0, "m"),
    "block_height_m": Limits(0.001, 100.0, "m"),
}
"""What the numbers of `GraphConfig` may be; graph specs and their documentation keep to it."""

# What the other fields may be, by the type they are declared with, and how messages say it.
_KINDS: dict[str, tuple[Callable[[object], bool], str]] = {
    "bool": (lambda value: isinstance(value, bool), "True or False"),
    "bool | None": (lambda value: value is None or isinstance(value, bool), "True, False or None"),
    "Coordinates": (
        lambda value: isinstance(value, Coordinates),
        "one of " + ", ".join(str(one) for one in Coordinates),
    ),
}


@dataclass(frozen=True)
class GraphConfig:
    """Settings by which a motion graph is built. Numbers are within `LIMITS`.

    Attributes:
        fps: Frame rate of its frames [1/s]; the paper's is 15.
        mirrored: Whether the mirror image of every motion is added.
        coordinates: Coordinates in which frames are compared.
        contact_change: Whether jumps are allowed only where a contact begins or ends: the strict
            form of the first pruning rule.
        sigma: Distance at which the probability has fallen to 1/e (eq. 1).
        least_probability: Jumps with exp(-D / sigma) below it are dropped: the second rule.
        velocity_weight: Weight of squared velocity differences [s^2], the nu of eq. 2: the square
            of the time, here 0.15 s, in which a difference in velocity counts as much as the
            difference in pose that it leads to. Angles and their rates are halved, as in eq. 3.
        local_maxima: Whether only the best of neighbouring jumps is kept: the third rule. None
            does as the paper: the rule is used unless contact_change is set.
        stutter_s: Jumps within a clip that skip or repeat less than this are dropped [s].
        slip_m: A jump is dropped if a foot stands from its first frame to the end of the blend
            (the paper's case 4) and would move farther than this [m].
        blend_s: Time over which a jump is blended [s]; 1 to 2 in the paper.
        blend_rate_s: Time over which the difference in velocity at a jump decays, at most blend_s
            [s]. The paper has one time for both. But a joint that is 3 rad/s faster before the
            jump would swing 25 degrees too far in a blend of 1 s, and a third of that in 0.3 s.
            The root takes twice this time.
        block_m: Side of a block of `Coordinates.BLOCKS` [m].
        block_height_m: Height of a block [m].
    """

    fps: float = 15.0
    mirrored: bool = False
    coordinates: Coordinates = Coordinates.RELATIVE
    contact_change: bool = True
    sigma: float = 0.05
    least_probability: float = 0.02
    velocity_weight: float = 0.0225
    local_maxima: bool | None = None
    stutter_s: float = 0.25
    slip_m: float = 0.03
    blend_s: float = 1.0
    blend_rate_s: float = 0.3
    block_m: float = 0.6096
    block_height_m: float = 0.1905

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            UsageError: A setting is of the wrong type or outside of `LIMITS`, or two contradict
                each other.
        """
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if field.name in LIMITS:
                check_number(field.name, value, *LIMITS[field.name])
                continue
            right, expected = _KINDS[str(field.type)]
            if not right(value):
                raise UsageError(f"{field.name} must be {expected}, got {value!r:.60}")
        if self.blend_rate_s > self.blend_s:
            raise UsageError(
                f"blend_rate_s must be at most blend_s, {self.blend_s:g}, got {self.blend_rate_s:g}"
            )
        if self.mirrored and self.coordinates is Coordinates.FIXED:
            raise UsageError(
                "mirrored motion in fixed coordinates would stand in a mirrored world; "
                "use relative coordinates, or leave mirrored out"
            )

    @property
    def keeps_local_maxima(self) -> bool:
        """Whether the third rule is used."""
        return not self.contact_change if self.local_maxima is None else self.local_maxima

    @property
    def max_distance(self) -> float:
        """Largest distance of a jump that passes the second rule."""
        return -self.sigma * math.log(self.least_probability)
