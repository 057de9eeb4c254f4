"""Prepares an impact for the simulation: where it starts, how fast, and from which frame on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import ROOT, ROOT_QUAT, Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Ball, Impact, Punch, Push, Strike
from dynresp.physics.scene import ImpactorKind, PhysicsConfig
from dynresp.support.errors import SpecError

# Acceleration of gravity [m/s2].
GRAVITY = 9.81
# A ball or a fist starts this long before it is due [s], or with its surface this far from the
# target [m], whichever is earlier, so that it does not touch the character when the simulation
# begins.
APPROACH_S = 0.2
APPROACH_M = 0.7
# An impact that has touched nothing this long after it was due is a miss [s].
WAIT_S = 0.2
# Gap between the floor and a ball that starts just above it [m].
_FLOOR_GAP = 0.005
# Moment of inertia of a solid sphere, in units of m r^2.
_SPHERE_INERTIA = 0.4


@dataclass(frozen=True)
class PreparedImpact:
    """An impact as the simulation needs it. Times count from the simulation's first frame.

    Attributes:
        kind: The scene that it needs.
        start: The simulation's first frame, counted in the base motion.
        due_s: When the impact is due [s].
        impactor_pose: (7,) position [m] and quaternion w x y z at the start; None for a push.
        impactor_velocity: (6,) linear [m/s] and angular [rad/s] velocity; None for a push.
        mass: Mass of a ball or fist [kg].
        radius: Radius of a ball or fist [m].
        weightless: Whether gravity does not act on it.
        wrench_body: Index of the body that is pushed, -1 without a push.
        push_start_s: When the push begins [s].
        push_force: (3,) peak force of a push [N], world; else None.
        push_duration_s: How long the push lasts [s].
        strike_poses: (frames, 7) recorded poses of the striking forearm at the simulation's frame
            rate, position [m] and quaternion w x y z; None without a strike.
        opponent: The second character, placed, at the simulation's frame rate; None without a
            strike.
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
    """Find where the impact starts, and at which frame the simulation must begin.

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
    """How long before it is due a ball or fist of a radius [m] and speed [m/s] starts [s]."""
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
    """The point at which an impact is aimed (3,) [m], world."""
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
        # A level ball at a low target would start below the floor. It starts just above the floor
        # instead, and falls a little at the target.
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
    # It faces along the direction of the strike when the fist is due.
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
    """Centre of the hand in a pose (3,) [m], world."""
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
