"""What can hit a character: `Ball`, `Punch`, `Push` and `Strike`.

Directions are those from which an impact comes, relative to the character's facing at the moment
at which the impact is due.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from dynresp.motion.motion import Motion
from dynresp.support.checks import check_number
from dynresp.support.errors import SpecError, UsageError


@dataclass(frozen=True)
class Ball:
    """A thrown ball that flies freely, under gravity.

    Its path is a parabola through the target. If that parabola would start below the floor (a low
    target, or a slow ball), the ball starts just above the floor: it still passes through the
    target on time, but at another angle.

    Attributes:
        time: When the ball's centre would be at the target if nothing were in the way [s], from
            the start of the base motion; in `Crowd`, from now. The ball starts 0.2 s earlier,
            or as long as it needs for 0.7 m if that is longer, so `time` must be at least that.
        speed: Speed at the target [m/s], 2 to 2000.
        mass: Mass [kg], 0.01 to 200.
        radius: Radius [m], 0.01 to 1.
        from_deg: Direction from which it comes, seen from above and relative to the character's
            facing at `time` [degrees]: 0 from the front, 90 from its left, 180 from behind, 270
            or -90 from its right.
        elevation_deg: Angle above the horizontal from which it comes [degrees], -89 to 89: 0 is
            level, 30 falls by 30 degrees.
        target: Name of the body it is aimed at, such as "head", "chest" or "left_thigh"
            (`Character.body_names` lists all 14).
        height: None aims at the target's centre of mass. A number aims at the vertical line
            through the character's pelvis, at this height above the ground [m], 0 to 3.
        offset: Distance by which it is aimed past the target, to the thrower's right [m], -10 to
            10.

    Raises:
        SpecError: A number is out of its range.

    Examples:
        A ball of 4 kg against the chest, from the character's left:

        >>> import dynresp
        >>> ball = dynresp.Ball(time=1.5, speed=10.0, mass=4.0, from_deg=90.0)
        >>> ball.target
        'chest'
    """

    time: float
    speed: float = 8.0
    mass: float = 6.0
    radius: float = 0.12
    from_deg: float = 0.0
    elevation_deg: float = 0.0
    target: str = "chest"
    height: float | None = None
    offset: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)


@dataclass(frozen=True)
class Punch(Ball):
    """A sphere of the size of a fist that flies in a straight line, as if carried by an arm.

    Gravity does not act on it. All attributes and ranges are those of `Ball`; only defaults differ.

    Attributes:
        speed: Speed at the target [m/s].
        mass: Effective mass of the punch [kg]: 2 to 5 kg were measured in boxers (Walilko, Viano &
            Bir 2005, Br. J. Sports Medicine 39, 710-719: 2.9 kg).
        radius: Radius of the fist [m].
        target: Name of the body it is aimed at.

    Examples:
        >>> import dynresp
        >>> punch = dynresp.Punch(time=1.0, from_deg=0.0)
        >>> punch.target, punch.mass
        ('head', 2.9)
    """

    speed: float = 9.0
    mass: float = 2.9
    radius: float = 0.05
    target: str = "head"


@dataclass(frozen=True)
class Push:
    """A force on one body that rises and falls as a half sine.

    Its impulse is 2 / pi * force * duration [N s].

    Attributes:
        time: When it begins [s], from the start of the base motion; in `Crowd`, from now. This is
            the moment of contact.
        force: Peak force [N], 0 to 50 000.
        duration: How long it lasts [s], 0.005 to 5.
        from_deg: Direction from which it comes, seen from above and relative to the character's
            facing at `time` [degrees]: 0 from the front, 90 from its left, 180 from behind, 270
            or -90 from its right.
        elevation_deg: Angle above the horizontal from which it comes [degrees], -89 to 89;
            positive angles press down.
        target: Name of the body on whose centre of mass it acts (`Character.body_names`).

    Raises:
        SpecError: A number is out of its range.

    Examples:
        A push from behind:

        >>> import dynresp
        >>> push = dynresp.Push(time=1.0, force=900.0, duration=0.2, from_deg=180.0)
        >>> push.target
        'chest'
    """

    time: float
    force: float = 600.0
    duration: float = 0.2
    from_deg: float = 0.0
    elevation_deg: float = 0.0
    target: str = "chest"

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)


@dataclass(frozen=True)
class Strike:
    """The recorded strike of a second character, whose forearm and fist hit.

    The second character is turned and moved on the ground so that its fist is over the target when
    it is due. It keeps its own height. Only its forearm and fist are simulated, with 4 kg; they are
    drawn along the recorded path.

    Attributes:
        time: When the fist is due at the target [s], from the start of the base motion; in `Crowd`,
            from now. At least 0.2.
        motion: The second character's motion, at any frame rate.
        motion_time: Time in `motion` at which the fist meets the target [s].
        side: "left" or "right", the arm that strikes.
        from_deg: Direction from which it comes, seen from above and relative to the character's
            facing at `time` [degrees]: 0 from the front, 90 from its left, 180 from behind, 270
            or -90 from its right.
        target: Name of the body it is aimed at (`Character.body_names`). Only the place on the
            ground follows it, not the height.

    Raises:
        SpecError: A number is out of its range, or `side` is another word.
    """

    time: float
    motion: Motion
    motion_time: float
    side: str = "right"
    from_deg: float = 0.0
    target: str = "head"

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self)
        if self.side not in ("left", "right"):
            raise SpecError(f"side must be left or right, got {self.side!r}")


Impact: TypeAlias = Ball | Punch | Push | Strike

BOUNDS = {
    "time": (0.0, 1e6, "s"),
    "speed": (2.0, 2000.0, "m/s"),
    "mass": (0.01, 200.0, "kg"),
    "radius": (0.01, 1.0, "m"),
    "from_deg": (-720.0, 720.0, "degrees"),
    "elevation_deg": (-89.0, 89.0, "degrees"),
    "height": (0.0, 3.0, "m"),
    "offset": (-10.0, 10.0, "m"),
    "force": (0.0, 50_000.0, "N"),
    "duration": (0.005, 5.0, "s"),
    "motion_time": (0.0, 1e6, "s"),
}
"""Least and largest value of every number of an impact, and its unit."""


def _check(impact: Impact) -> None:
    """Refuse what is not a finite number within its bounds.

    Raises:
        SpecError: The message names the number, what was given and what is allowed.
    """
    for name, (low, high, unit) in BOUNDS.items():
        value = getattr(impact, name, None)
        if value is None:
            continue
        try:
            check_number(name, value, low, high, unit)
        except UsageError as error:
            raise SpecError(str(error)) from None
