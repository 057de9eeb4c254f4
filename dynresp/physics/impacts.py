"""What hits the character: balls, punches, pushes, and another character's strike.

Directions are told from the character's side, at the moment of the hit: `from_deg` is the compass
bearing the impact comes from, seen from above, about the character's facing: 0 from the front, 90
from its left, 180 from behind, 270 (or -90) from its right. `elevation_deg` is how far above the
level it comes from.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT, Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.physics.scene import ImpactorKind, PhysicsConfig
from dynresp.support.errors import SpecError

GRAVITY = 9.81
# A ball or a fist is let go this long before it is due [s] or with its surface this far away [m],
# whichever is earlier, so that it is clear of the character when the simulation begins; and it is
# waited for this long after, before it counts as a miss [s].
APPROACH_S = 0.2
APPROACH_M = 0.7
WAIT_S = 0.2
_FLOOR_GAP = 0.005
# A body of solid stuff: moment of inertia of a sphere, 2/5 m r^2.
_SPHERE_INERTIA = 0.4


@dataclass(frozen=True)
class Ball:
    """A thrown ball, which flies freely.

    One whose way to its target would begin in the floor (a low target, or a slow ball) is let go
    just above it instead: it comes in time and place, but steeper than asked.

    Attributes:
        time: When its centre is due at the target, were nothing in its way [s].
        speed: Its speed there [m/s].
        mass: [kg].
        radius: [m].
        from_deg: Where it comes from (see above).
        elevation_deg: How steeply it falls.
        target: Name of the body it is aimed at.
        height: If given, it is aimed at the body's vertical axis at this height [m] instead of
            at the target's centre of mass.
        offset: Sideways miss of the target, to the thrower's right [m].
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
    """A fist-sized mass that comes straight in, carried by an arm that is not simulated.

    Attributes are those of `Ball`; the mass is the effective mass of a punch, of which 2 to 5 kg
    are measured in boxers (Walilko, Viano & Bir 2005, Br. J. Sports Medicine 39, 710-719: 2.9 kg).
    """

    speed: float = 9.0
    mass: float = 2.9
    radius: float = 0.05
    target: str = "head"


@dataclass(frozen=True)
class Push:
    """A force on a body over time, rising and falling as a half sine.

    Attributes:
        time: When it begins [s]; that is the moment of contact.
        force: Its peak [N].
        duration: How long it lasts [s].
        from_deg: Where it comes from (see above).
        elevation_deg: How far it presses down.
        target: Name of the body it acts on, at its centre of mass.
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
    """A second character's recorded strike, whose forearm and fist hit as a moving body.

    The second character is placed so that its fist meets the target when it is due.

    Attributes:
        time: When the fist is due at the target [s].
        motion: The second character's motion, at any frame rate.
        motion_time: Time in it at which the fist meets the target [s].
        side: "left" or "right", the arm that strikes.
        from_deg: Where it comes from (see above).
        target: Name of the body it is aimed at; only the fist's place on the ground is adapted,
            so the strike keeps its own height.
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
    "time": (0.0, 1e6),
    "speed": (2.0, 2000.0),
    "mass": (0.01, 200.0),
    "radius": (0.01, 1.0),
    "from_deg": (-720.0, 720.0),
    "elevation_deg": (-89.0, 89.0),
    "height": (0.0, 3.0),
    "offset": (-10.0, 10.0),
    "force": (0.0, 50_000.0),
    "duration": (0.005, 5.0),
    "motion_time": (0.0, 1e6),
}
"""Least and greatest value of every number of an impact, in the units given above."""


def _check(impact: Impact) -> None:
    """Refuse numbers that are not finite or out of bounds.

    Raises:
        SpecError: Names the number, what was given and what is allowed.
    """
    for name, (least, most) in BOUNDS.items():
        value = getattr(impact, name, None)
        # Written so that what is not a number is refused, too.
        if value is not None and not least <= value <= most:
            raise SpecError(f"{name} must be from {least:g} to {most:g}, got {value!r}")


@dataclass(frozen=True)
class PreparedImpact:
    """An impact in terms of the simulation, whose time 0 is its first frame.

    Attributes:
        kind: The scene it needs.
        start: The simulation's first frame, counted in the base motion.
        impactor_pose: (7,) position [m] and quaternion at the start; None without impactor.
        impactor_velocity: (6,) linear [m/s] and angular [rad/s] velocity.
        mass: Of the impactor [kg].
        radius: Of a sphere [m].
        weightless: Whether gravity leaves it alone.
        wrench_body: Index of the body that is pushed, -1 for none.
        push_start_s: When the push begins, from the start [s].
        push_force: (3,) peak force [N], world.
        push_duration_s: [s].
        strike_poses: (frames, 7) recorded poses of the striking forearm at the simulation's frame
            rate; None without strike.
        opponent: The second character, placed, at the simulation's frame rate; None without.
        due_s: When the impact is due, from the start [s].
    """

    kind: ImpactorKind
    start: int
    due_s: float
    impactor_pose: FloatArray | None = None
    impactor_velocity: FloatArray | None = None
    mass: float = 0.0
    radius: float = 0.0
    weightless: bool = False
    wrench_body: int = -1
    push_start_s: float = 0.0
    push_force: FloatArray | None = None
    push_duration_s: float = 0.0
    strike_poses: FloatArray | None = None
    opponent: Motion | None = None


def prepare(
    impact: Impact, base: Motion, character: Character, config: PhysicsConfig
) -> PreparedImpact:
    """Work out where the impact starts from and when the simulation must begin.

    Args:
        impact: What hits.
        base: The base motion, at the simulation's frame rate.
        character: The character.
        config: The simulation's settings.

    Raises:
        SpecError: The impact comes before the base motion has begun or after it has ended.
    """
    lead = 0.0 if isinstance(impact, Push) else APPROACH_S
    if isinstance(impact, Ball):
        lead = flight_s(impact.radius, impact.speed)
    start = int(np.floor((impact.time - lead) * base.fps + 1e-9))
    if start < 0 or impact.time > base.duration:
        raise SpecError(
            f"time: the impact is due at {impact.time:g} s; with this base motion it can be "
            f"from {lead:g} to {base.duration:g} s"
        )
    due_s = impact.time - start / base.fps
    if isinstance(impact, Push):
        direction = _direction(impact, base)
        return PreparedImpact(
            ImpactorKind.NONE,
            start,
            due_s,
            wrench_body=character.body(impact.target),
            push_start_s=due_s,
            push_force=impact.force * direction,
            push_duration_s=impact.duration,
        )
    if isinstance(impact, Strike):
        return _prepare_strike(impact, base, character, config, start, due_s)
    return _prepare_projectile(impact, base, character, start, due_s)


def flight_s(radius: float, speed: float) -> float:
    """How long before it is due a ball or a fist of a radius [m] and speed [m/s] is let go [s]."""
    return max(APPROACH_S, (APPROACH_M + radius) / speed)


def _direction(impact: Impact, base: Motion) -> FloatArray:
    """Unit vector (3,) in the world along which the impact moves when it is due."""
    facing = float(rotations.yaw_of(base.sample([impact.time])[0, ROOT_QUAT]))
    bearing = facing + np.radians(impact.from_deg)
    elevation = np.radians(getattr(impact, "elevation_deg", 0.0))
    level = np.cos(elevation)
    return -np.array([level * np.cos(bearing), level * np.sin(bearing), np.sin(elevation)])


def _target(
    base: Motion, character: Character, time: float, body: str, height: float | None
) -> FloatArray:
    """Where an impact is aimed at (3,) [m]."""
    pose = base.sample([time])
    point = character.kinematics(pose).centers[0, character.body(body)].copy()
    if height is not None:
        point = np.array([*pose[0, ROOT][:2], height])
    return point


def _prepare_projectile(
    impact: Ball | Punch, base: Motion, character: Character, start: int, due_s: float
) -> PreparedImpact:
    direction = _direction(impact, base)
    right = np.cross(direction, [0.0, 0.0, 1.0])
    right /= max(float(np.linalg.norm(right)), 1e-9)
    target = _target(base, character, impact.time, impact.target, impact.height)
    velocity = impact.speed * direction
    weightless = isinstance(impact, Punch)
    pull = np.array([0.0, 0.0, 0.0 if weightless else -GRAVITY])
    goal = target + impact.offset * right
    position = goal - velocity * due_s + 0.5 * pull * due_s**2
    if position[2] < impact.radius:
        # A ball that comes level at a low target would have come through the floor: it is let go
        # just above it, and falls a little at the target.
        position[2] = impact.radius + _FLOOR_GAP
        velocity[2] = (goal[2] - position[2]) / due_s + 0.5 * pull[2] * due_s
    return PreparedImpact(
        ImpactorKind.PROJECTILE,
        start,
        due_s,
        impactor_pose=np.concatenate([position, [1.0, 0.0, 0.0, 0.0]]),
        impactor_velocity=np.concatenate([velocity - pull * due_s, np.zeros(3)]),
        mass=impact.mass,
        radius=impact.radius,
        weightless=weightless,
    )


def _prepare_strike(
    impact: Strike,
    base: Motion,
    character: Character,
    config: PhysicsConfig,
    start: int,
    due_s: float,
) -> PreparedImpact:
    motion = impact.motion
    if not 0.0 <= impact.motion_time <= motion.duration:
        raise SpecError(
            f"strike: motion_time is {impact.motion_time:g} s, but {motion.name!r} lasts "
            f"{motion.duration:g} s"
        )
    direction = _direction(impact, base)
    target = _target(base, character, impact.time, impact.target, None)
    # It faces along the blow when the fist is due.
    facing = rotations.yaw_of(motion.sample([impact.motion_time])[0, ROOT_QUAT])
    turn = float(np.arctan2(direction[1], direction[0]) - facing)
    placed = motion.moved(turn, np.zeros(3))
    forearm = character.body(f"{impact.side}_forearm")
    reach = _fist(character, placed.sample([impact.motion_time]), forearm)
    placed = placed.moved(0.0, np.array([*(target - reach)[:2], 0.0]))
    frames = int(np.ceil((due_s + WAIT_S + 2.0) * config.fps))
    times = impact.motion_time - due_s + np.arange(frames) / config.fps
    opponent = Motion(placed.sample(times), config.fps, motion.name)
    states = character.kinematics(opponent.poses)
    track = np.concatenate(
        [states.positions[:, forearm], rotations.make_continuous(states.quaternions[:, forearm])],
        axis=1,
    )
    speed = (track[1, :3] - track[0, :3]) * config.fps
    turned = rotations.multiply(rotations.conjugate(track[0, 3:]), track[1, 3:])
    spin = rotations.to_rotation_vector(turned) * config.fps
    return PreparedImpact(
        ImpactorKind.STRIKER,
        start,
        due_s,
        impactor_pose=track[0],
        impactor_velocity=np.concatenate([speed, spin]),
        strike_poses=track,
        opponent=opponent,
    )


def _fist(character: Character, poses: npt.ArrayLike, forearm: int) -> FloatArray:
    """Where the middle of the hand is in a pose (3,) [m]."""
    states = character.kinematics(poses)
    hand = character.model.geom(f"{character.body_names[forearm].split('_')[0]}_hand").pos
    return states.positions[0, forearm] + rotations.rotate(states.quaternions[0, forearm], hand)


def sphere_inertia(mass: float, radius: float) -> float:
    """Moment of inertia of a solid sphere [kg m2]."""
    return _SPHERE_INERTIA * mass * radius**2


def push_profile(time: npt.ArrayLike, start: float, duration: float) -> FloatArray:
    """Share of the peak force at given times [s]: a half sine from start to start + duration."""
    phase = (np.asarray(time, dtype=np.float64) - start) / duration
    return np.where((phase >= 0.0) & (phase <= 1.0), np.sin(np.pi * np.clip(phase, 0.0, 1.0)), 0.0)
