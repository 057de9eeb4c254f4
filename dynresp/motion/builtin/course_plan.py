"""From the moves of a course to a plan of feet, centre of pressure and posture over time.

The plan says where and when each foot stands, where the ground bears the body (the centre of
pressure), how high the pelvis is, which way the body faces and what posture it takes on the way;
`course` turns it into poses.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import NamedTuple

from dynresp.motion.builtin.course_postures import JUMP_POSTURES, Channels, channels_of
from dynresp.motion.builtin.course_spec import Course, Jump, Stay, Step

STANDING = 0.925
"""Height of the pelvis over the surface while both feet stand side by side [m]."""
FULL_STEP = 0.66
"""Length of a step of ordinary walking [m], `reactions/builtin/walk.toml`."""
GRAVITY = 9.81
SWING_PITCH = (-63.6, -72.7, -69.3, -58.3, -45.1, -30.9, -15.4, -0.7, 11.2, 18.0, 15.5)
"""Pitch of the foot [deg], at equal times from leaving to touching down, of a full stride."""

# Between the ankles at the start [m].
_APART = 0.20
# Turn of the toes outward, walking [deg]; from the same file.
_TOE_OUT = 6.0
# Part of a step's time in which both feet stand: two double supports of 11 % of the cycle there.
_DOUBLE = 0.22
# Time to shift the weight onto one foot before the first step [s] (Brenière & Do 1986, J.
# Biomechanics 19(12): anticipation takes about half a second).
_SHIFT_S = 0.45
# The middle of the foot is this far before the ankle [m] (models/ragdoll.xml).
_MIDFOOT = 0.035
# How far the pelvis is lower at the longest spread of the legs and at mid-stance than standing [m],
# in ordinary walking: 2.5 cm apart, as in the same file.
_SPREAD_DROP, _PASSING_DROP = 0.027, 0.002
# Steps up and down: the part of the surface's rise that the pelvis has gone half-way through the
# swing and just after the landing, of the first foot and of the one that follows.
_RISING = (0.0, 0.15, 0.75)
_SINKING = (0.30, 0.88, 1.0)
# A jump: seconds of the crouch before it and of rising after it; heights of the pelvis over
# standing as the feet leave and land [m].
_CROUCH_S, _RECOVER_S = 0.5, 0.6
_STRETCHED, _LANDING = 0.03, -0.08


class Placement(NamedTuple):
    """A point on a surface: x, y, z [m], and the direction it faces [rad]."""

    x: float
    y: float
    z: float
    yaw: float

    def on(self, forward: float, left: float, up: float = 0.0, turn: float = 0.0) -> Placement:
        """The placement that is so far ahead, to the left and up [m], turned to the left [rad]."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return Placement(
            self.x + cos * forward - sin * left,
            self.y + sin * forward + cos * left,
            self.z + up,
            self.yaw + turn,
        )


@dataclass(frozen=True)
class Footfall:
    """One stance of a foot, and the swing before it.

    Attributes:
        place: Where its ankle is over the surface while it stands flat, and where the toes point.
        land: When it touches down [s]; 0 for the first stance.
        leave: When it leaves [s]; the end of the course for the last stance.
        land_pitch: The toes are up by this when it touches down [deg].
        leave_pitch: The same when it leaves; below 0 the heel is up.
        reach: How far ahead of its last stance, in full strides of ordinary walking; below 0
            backward.
        size: Distance from there, in full strides, at most 1.
        top: Height at which the sole passes in the swing [m], None for the low swing of walking.
        over: From how far to how far before the landing it does [m].
        hop: Whether the body flies and takes both feet along.
    """

    place: Placement
    land: float
    leave: float
    land_pitch: float = 0.0
    leave_pitch: float = 0.0
    reach: float = 0.0
    size: float = 0.0
    top: float | None = None
    over: tuple[float, float] = (math.inf, 0.0)
    hop: bool = False


@dataclass
class CoursePlan:
    """Feet, centre of pressure and posture over time; see the module.

    Attributes:
        feet: Stances of the left and the right foot, in order of time.
        pressure: (time [s], x, y, z [m]) through which the centre of pressure goes in straight
            lines.
        heights: (time, height of the pelvis [m], its speed [m/s], nan where it is free).
        headings: (time, facing [rad]).
        postures: (time, channels [deg, m] added to what walking and standing give).
        phrases: (name as in the route, start, stop [s]).
        duration: [s].
    """

    feet: tuple[list[Footfall], list[Footfall]]
    pressure: list[tuple[float, float, float, float]] = field(default_factory=list)
    heights: list[tuple[float, float, float]] = field(default_factory=list)
    headings: list[tuple[float, float]] = field(default_factory=list)
    postures: list[tuple[float, Channels]] = field(default_factory=list)
    phrases: list[tuple[str, float, float]] = field(default_factory=list)
    duration: float = 0.0


def plan_course(course: Course) -> CoursePlan:
    """The plan of a course."""
    planner = _Planner(course)
    for name in course.route:
        start = planner.time
        for move, mirrored in course.moves_of(name):
            match move:
                case Step():
                    planner.step(move, mirrored)
                case Stay():
                    planner.stay(move, mirrored)
                case Jump():
                    planner.jump(move)
        planner.plan.phrases.append((name, start, planner.time))
    return planner.finished()


class _Planner:
    """Builds the plan move by move; knows where the body is."""

    def __init__(self, course: Course) -> None:
        x, y, facing = course.start
        self.body = Placement(x, y, 0.0, math.radians(facing))
        first = [[Footfall(self._beside(i, _APART), 0.0, 0.0)] for i in range(2)]
        self.plan = CoursePlan((first[0], first[1]))
        self.time = 0.0
        self.next = 0
        self.stood = True
        self.plan.headings.append((0.0, self.body.yaw))
        self.plan.heights.append((0.0, STANDING, 0.0))
        self.plan.postures.append((0.0, {}))
        self._press(0.0, self._middle())

    def step(self, move: Step, mirrored: bool) -> None:
        sign = -1.0 if mirrored else 1.0
        if move.foot is not None:
            self.next = int((move.foot == "right") != mirrored)
        posture = channels_of(move.posture, mirrored)
        for number in range(move.count):
            i, other = self.next, 1 - self.next
            self.body = self.body.on(
                move.forward, sign * move.left, move.up, sign * math.radians(move.turn)
            )
            double = _SHIFT_S if self.stood else _DOUBLE * move.time
            leave = self.time + (double if move.double is None or number else move.double)
            land = leave + (1.0 - _DOUBLE) * move.time
            before, stands = self.plan.feet[i][-1], self.plan.feet[other][-1].place
            after = self._beside(i, move.apart)
            fall, heel = _fall(move, before.place, after, land)
            self.plan.feet[i][-1] = dataclasses.replace(before, leave=leave, leave_pitch=heel)
            self.plan.feet[i].append(fall)
            if self.stood:
                self.plan.headings.append((leave - 0.15, self.plan.headings[-1][1]))
                self.plan.heights.append((leave - 0.1, self.plan.heights[-1][1], math.nan))
            settled = land + 0.5 * _DOUBLE * move.time
            self._press(leave, stands.on(_MIDFOOT - 0.03 * fall.reach, 0.0))
            self._press(land, stands.on(_MIDFOOT + 0.10 * fall.reach, 0.0))
            self.plan.headings.append((settled, self.body.yaw))
            self._heights_of_step(before.place, stands, after, (0.5 * (leave + land), settled))
            if number in (0, move.count - 1):
                self.plan.postures.append((land, posture))
            self.time, self.next, self.stood = land, other, False

    def _heights_of_step(
        self, before: Placement, stands: Placement, after: Placement, times: tuple[float, float]
    ) -> None:
        """The pelvis half-way through a swing, and when both feet stand again."""
        ahead = (after.x - stands.x) * math.cos(after.yaw) + (after.y - stands.y) * math.sin(
            after.yaw
        )
        spread = min(abs(ahead) / FULL_STEP, 1.3) ** 2
        rise = after.z - stands.z
        if rise >= 0:
            passing, landed = stands.z + _RISING[0] * rise, stands.z + _RISING[1] * rise
        else:
            passing, landed = stands.z + _SINKING[0] * rise, stands.z + _SINKING[1] * rise
        if rise == 0:
            # The foot that follows comes from the surface that the other has left.
            share = _RISING[2] if before.z < stands.z else _SINKING[2]
            passing, landed = before.z + share * (stands.z - before.z), stands.z
        self.plan.heights += [
            (times[0], passing + STANDING - _PASSING_DROP * spread, math.nan),
            (times[1], landed + STANDING - _SPREAD_DROP * spread, math.nan),
        ]

    def stay(self, move: Stay, mirrored: bool) -> None:
        self.time += move.time
        forward, left = move.at
        self._press(self.time, self._middle().on(forward, -left if mirrored else left))
        self.plan.headings.append((self.time, self.body.yaw))
        self.plan.heights.append((self.time, self.body.z + STANDING, 0.0))
        self.plan.postures.append((self.time, channels_of(move.posture, mirrored)))
        self.stood = True

    def jump(self, move: Jump) -> None:
        """Crouch, push off with a constant force, fly, give way with one, rise."""
        low, high = self.body.z, self.body.z + move.up
        gain = move.up + _LANDING - _STRETCHED
        rising = (gain + 0.5 * GRAVITY * move.time**2) / move.time
        falling = rising - GRAVITY * move.time
        crouched = self.time + _CROUCH_S
        leave = crouched + 2.0 * (move.depth + _STRETCHED) / rising
        land = leave + move.time
        bottom = land + 2.0 * (move.depth + _LANDING) / -falling
        self.time = bottom + _RECOVER_S
        self._press(crouched, self._middle())
        self._press(leave, self._middle().on(0.08, 0.0))
        self.body = self.body.on(move.forward, 0.0, move.up)
        reach = move.forward / (2.0 * FULL_STEP)
        for i, falls in enumerate(self.plan.feet):
            falls[-1] = dataclasses.replace(falls[-1], leave=leave, leave_pitch=-50.0)
            place, top = self._beside(i, move.apart), max(low, high) + move.lift
            falls.append(Footfall(place, land, land, -15.0, 0.0, reach, 0.0, top, hop=True))
        self._press(land, self._middle().on(0.05, 0.0))
        self._press(bottom, self._middle())
        self._press(self.time, self._middle())
        self.plan.heights += [
            (crouched, low + STANDING - move.depth, 0.0),
            (leave, low + STANDING + _STRETCHED, rising),
            (land, high + STANDING + _LANDING, falling),
            (bottom, high + STANDING - move.depth, 0.0),
            (self.time, high + STANDING, 0.0),
        ]
        times = (crouched, leave, 0.5 * (leave + land), land, bottom, self.time)
        self.plan.postures += zip(times, JUMP_POSTURES, strict=True)
        self.plan.headings.append((self.time, self.body.yaw))
        self.stood = True

    def finished(self) -> CoursePlan:
        for falls in self.plan.feet:
            falls[-1] = dataclasses.replace(falls[-1], leave=math.inf)
        self.plan.duration = self.time
        return self.plan

    def _beside(self, i: int, apart: float) -> Placement:
        """Where the left (0) or right (1) foot stands where the body is."""
        side = 1.0 - 2.0 * i
        return self.body.on(0.0, 0.5 * side * apart, 0.0, side * math.radians(_TOE_OUT))

    def _middle(self) -> Placement:
        """Midway between the feet, facing as the body does."""
        (ax, ay, az, _), (bx, by, bz, _) = (
            falls[-1].place.on(_MIDFOOT, 0.0) for falls in self.plan.feet
        )
        return Placement(0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (az + bz), self.body.yaw)

    def _press(self, time: float, at: Placement) -> None:
        self.plan.pressure.append((time, at.x, at.y, at.z))


def _fall(move: Step, before: Placement, after: Placement, land: float) -> tuple[Footfall, float]:
    """The stance that a step leads to, and the pitch of the foot as it leaves for it [deg]."""
    middle = 0.5 * (before.yaw + after.yaw)
    ahead = (after.x - before.x) * math.cos(middle) + (after.y - before.y) * math.sin(middle)
    distance = math.hypot(after.x - before.x, after.y - before.y)
    reach = max(-1.0, min(ahead / (2.0 * FULL_STEP), 1.1))
    climbs = after.z - before.z
    if move.lift or climbs:
        top = max(before.z, after.z) + move.lift
        # Down onto the ball of the foot, up and level onto the whole sole.
        heel, pitch = -35.0, -22.0 if climbs < 0 else 4.0
    elif reach >= 0:
        top, heel, pitch = None, -max(SWING_PITCH[0] * -reach, 14.0), SWING_PITCH[-1] * reach
    else:
        # Walking backward is walking forward reversed (Winter, Pluck & Yang 1989, J. Motor
        # Behavior 21(3)), with less of a roll over the toes.
        top, heel, pitch = None, -SWING_PITCH[-1] * reach, -0.6 * SWING_PITCH[0] * reach
    heel = heel if move.heel is None else -move.heel
    pitch = pitch if move.land is None else move.land
    over = move.over or (math.inf, 0.0)
    size = min(distance / (2.0 * FULL_STEP), 1.0)
    return Footfall(after, land, land, pitch, 0.0, reach, size, top, over), heel
