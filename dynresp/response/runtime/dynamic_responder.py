"""One character at run time: it plays a motion, is hit and reacts (Zordan et al. 2007, figure 2).

Frames count on the character's clock, which runs at the simulation's frame rate and starts at 0.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion, pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Impact, Push
from dynresp.physics.prepared_impact import WAIT_S, PreparedImpact, prepare
from dynresp.physics.scene import PhysicsConfig
from dynresp.physics.trace import Setup, Trace
from dynresp.response.choice import Choice
from dynresp.response.response import CARRY_ON
from dynresp.response.transition.pose_timeline import PoseTimeline
from dynresp.support.errors import MotionError, SpecError

# A hit that is due before this time [s] is prepared from frame 0 on, so that its times are rounded
# as `Responder` rounds them. A later one is prepared from `_LEAD_S` before it is due, because a
# character may play for hours.
_FROM_START_S = 10.0
# More than any impact needs to arrive [s] (`dynresp.physics.prepared_impact.flight_s`).
_LEAD_S = 1.0
# A hit can be due at most this long from now [s].
_LATEST_S = 60.0
# A hit is prepared with the expected motion until this long after it is due [s]: the longest
# look-ahead, with room for the blend.
_AFTER_S = 5.0
# Number of events that are kept: those of at least a hundred hits.
_MAX_EVENTS = 600


class Phase(Enum):
    """What moves a character."""

    PLAYING = "playing"
    """A motion: the base motion, or a reaction after its blend."""
    APPROACH = "approach"
    """The simulation before contact, while an impact is on its way."""
    PHYSICS = "physics"
    """The simulation, after contact."""
    BLEND = "blend"
    """The blend from the simulation to what was chosen."""


class EventKind(Enum):
    """The six events of the paper's figure 2, and what can happen instead."""

    INVOKED = "invoked"
    """1: an impact is on its way; the simulation begins."""
    CONTACT = "contact"
    """2: the impact touches the character."""
    CHOSEN = "chosen"
    """3: the look-ahead is done; a reaction is chosen and aligned."""
    REWOUND = "rewound"
    """4: the simulation is taken back."""
    BLEND_BEGUN = "blend begun"
    """5: the exit: the blend from the simulation begins."""
    BLEND_ENDED = "blend ended"
    """6: the blend is over; the reaction or the base motion plays alone."""
    MISSED = "missed"
    """Nothing was hit: the character goes back to its motion."""
    DIVERGED = "diverged"
    """The simulation became unstable: the character goes back to its motion."""


@dataclass(frozen=True)
class Event:
    """Something that happened to a character.

    Attributes:
        kind: What happened.
        frame: Frame of the character's clock.
        choice: The choice, for `EventKind.CHOSEN`; None for other kinds.
    """

    kind: EventKind
    frame: int
    choice: Choice | None = None


@dataclass(frozen=True)
class PendingHit:
    """A hit whose simulation has not begun.

    Attributes:
        impact: What hits; its time counts from frame 0 of the clock.
        start: Frame at which its simulation begins.
        last_contact: Last frame at which it may still hit.
    """

    impact: Impact
    start: int
    last_contact: int


@dataclass
class SimulatedHit:
    """A hit whose simulation has begun. Frames are those of the character's clock.

    Attributes:
        pending: The hit as it was given.
        start: Frame at which its simulation began.
        setup: Where the simulation began, and what it tracks.
        base: What the character would do without the hit, from `start` on, for some seconds.
        trace: The simulation, at least to the exit; None before the choice.
        choice: The choice; None before it is made.
        exit: Frame at which the blend begins.
        end: Frame at which the blend has ended.
    """

    pending: PendingHit
    start: int
    setup: Setup
    base: Motion
    trace: Trace | None = None
    choice: Choice | None = None
    exit: int = 0
    end: int = 0


class DynamicResponder:
    """One character of a `Crowd`; `Crowd.advance` moves it on by one frame.

    Attributes:
        character: Its body.
        physics: Settings of the simulation.
        frame: The present frame of its clock.
        pose: (59,) the pose that it shows now.
        phase: What moves it.
        events: What happened to it, oldest first; at least the events of the last hundred hits.
        last_hit: The last hit whose simulation has begun; None before the first.
        takeovers: How often something other than `play` has replaced or moved what it plays: a
            reaction, no reaction (carry on) after a hit, or a miss that left it elsewhere.
    """

    def __init__(self, base: Motion, character: Character, physics: PhysicsConfig) -> None:
        """Start with the first frame of a motion; after its last frame the last pose holds."""
        self.character = character
        self.physics = physics
        self.frame = 0
        self.phase = Phase.PLAYING
        self.events: deque[Event] = deque(maxlen=_MAX_EVENTS)
        self.last_hit: SimulatedHit | None = None
        self.takeovers = 0
        self._timeline = PoseTimeline.of(base.poses, 0)
        self._name = base.name
        self.pose = base.poses[0]
        self._before: FloatArray | None = None
        self._pending: list[PendingHit] = []

    @property
    def free_from(self) -> int | None:
        """First frame from which `play` is allowed: the next frame, or the end of the blend.

        None in `Phase.PHYSICS`, because it is not known yet where the character goes on.
        """
        if self.phase is Phase.PHYSICS:
            return None
        if self.phase is Phase.BLEND and self.last_hit is not None:
            return max(self.last_hit.end, self.frame + 1)
        return self.frame + 1

    @property
    def planned_until(self) -> int:
        """One past the last frame for which there is a pose; from there on the last pose holds."""
        return self._timeline.end

    def planned(self, first: int, frames: int) -> FloatArray:
        """The poses (frames, 59) that it plays from a frame on, unless something hits it.

        In `Phase.PHYSICS` they are what it would have played without the hit.

        Args:
            first: The first frame, the present one or a later one.
            frames: How many.
        """
        return self._timeline.read(first, frames)

    def play(self, motion: Motion, first: int | None = None) -> None:
        """Play a motion from a frame on, in place of everything that was planned.

        Nothing is blended: the motion must continue the pose that `planned` gives for the frame
        before. An endless motion can be given piece by piece; the past is dropped. The motion is
        treated as any other: the servos track it while something approaches, the character goes
        back to it after a miss, and it is moved on the ground when there is no reaction (carry
        on). A reaction takes its place.

        Args:
            motion: The motion, at its place in the world and at the simulation's frame rate. After
                its last frame the last pose holds.
            first: Frame of the clock at which its first pose is due; `free_from` by default.

        Raises:
            SpecError: The character is not free at that frame.
            MotionError: The motion has another frame rate.
        """
        fps, free = self.physics.fps, self.free_from
        if motion.fps != fps:
            raise MotionError(
                f"motion {motion.name!r} has {motion.fps:g} fps, but the simulation runs at "
                f"{fps:g}; resample it"
            )
        if free is None:
            raise SpecError(
                "a character that was hit can play no other motion before its blend has begun; "
                "call `play` when `free_from` is a frame, not None"
            )
        if first is None:
            first = free
        if first < free:
            raise SpecError(f"first: the character is free from frame {free} on, got {first}")
        hit = self.last_hit if self.phase is Phase.APPROACH else None
        since = self.frame if hit is None else hit.start
        self._timeline = self._timeline.without_before(since).replaced_from(motion.poses, first)
        self._name = motion.name
        if hit is not None:
            hit.base = Motion(self.planned(hit.start, len(hit.base)), fps, self._name)
            hit.setup = replace(hit.setup, base=hit.base.poses)

    def hit(self, impact: Impact) -> None:
        """Let something hit the character.

        Args:
            impact: A `Ball`, `Punch`, `Push` or `Strike`; its `time` counts from now [s], at most
                60. A ball needs at least 0.2 s to arrive, a push no time.

        Raises:
            SpecError: It comes too soon or too late, or while something else is on its way.
        """
        fps = self.physics.fps
        if not impact.time <= _LATEST_S:
            raise SpecError(f"time must be at most {_LATEST_S:g} s from now, got {impact.time:g}")
        dated = replace(impact, time=impact.time + self.frame / fps)
        _, _, start = self._prepare(dated, self._expected())
        if start < self.frame:
            raise SpecError(
                f"time: the impact is due {impact.time:g} s from now and needs "
                f"{impact.time + (self.frame - start) / fps:.2f} s to come; give a later time"
            )
        wait_s = 0.0 if isinstance(impact, Push) else WAIT_S
        new = PendingHit(dated, start, int(np.ceil((dated.time + wait_s) * fps)))
        for other in self._on_the_way():
            if new.start <= other.last_contact and other.start <= new.last_contact:
                busy_s = (other.last_contact - self.frame) / fps
                raise SpecError(
                    f"time: something else may hit until {busy_s:.2f} s from now, and this would "
                    f"be on its way from {(new.start - self.frame) / fps:.2f} s on; one impact at "
                    f"a time can be on its way"
                )
        self._pending.append(new)

    # -- for the crowd --------------------------------------------------------------------------

    def start_hit(self) -> SimulatedHit | None:
        """Set up the simulation of the hit whose time has come; None if there is none."""
        pending = next((hit for hit in self._pending if hit.start <= self.frame), None)
        if pending is None:
            return None
        self._pending.remove(pending)
        if self.phase is Phase.PHYSICS:
            self._timeline = self._expected()
            self.takeovers += 1
        prepared, base, _ = self._prepare(pending.impact, self._timeline)
        held = self.phase is Phase.PLAYING
        setup = Setup(
            base.poses,
            prepared,
            velocity=self._velocity(),
            pose=None if held else self.pose,
            held=held,
        )
        self.last_hit = SimulatedHit(pending, self.frame, setup, base)
        self.phase = Phase.APPROACH
        self.add_event(EventKind.INVOKED)
        return self.last_hit

    def add_event(
        self, kind: EventKind, frame: int | None = None, choice: Choice | None = None
    ) -> None:
        """Record an event, by default at the present frame."""
        self.events.append(Event(kind, self.frame if frame is None else frame, choice))

    def show(self, pose: FloatArray) -> None:
        """Show a pose at the next frame of the clock."""
        self.frame += 1
        self._before, self.pose = self.pose, pose

    def enter(self, choice: Choice, simulated: FloatArray, poses: FloatArray) -> None:
        """Leave the simulation and begin the blend.

        Args:
            choice: The choice that was made.
            simulated: (59,) the simulated pose at the exit.
            poses: (frames, 59) from the exit on: the blend, and what follows it.
        """
        assert self.last_hit is not None
        timeline = PoseTimeline.of(poses, self.last_hit.exit)
        if choice.name == CARRY_ON:
            # After these poses the timeline goes on, however long it is.
            timeline = self._carry_on_timeline(choice, simulated, self.last_hit.exit)
            timeline = timeline.replaced_within(poses, self.last_hit.exit)
        self._timeline = timeline.without_before(self.last_hit.exit)
        self.takeovers += 1
        self.phase = Phase.BLEND

    def go_back(self, onto: FloatArray | None, poses: FloatArray) -> None:
        """Leave the simulation and blend back to the motion that was played.

        Args:
            onto: (59,) pose on which the timeline is placed; None leaves it where it is.
            poses: (frames, 59) the blend, from now on.
        """
        assert self.last_hit is not None
        timeline = self._timeline
        if onto is not None:
            timeline = timeline.placed_on(onto, self.frame)
            self.takeovers += 1
        self._timeline = timeline.replaced_within(poses, self.frame).without_before(self.frame)
        self.phase = Phase.BLEND

    # -- without a further hit ------------------------------------------------------------------

    def _on_the_way(self) -> list[PendingHit]:
        """The hits that have neither touched nor missed."""
        if self.phase is Phase.APPROACH and self.last_hit is not None:
            return [self.last_hit.pending, *self._pending]
        return self._pending

    def _prepare(
        self, impact: Impact, timeline: PoseTimeline
    ) -> tuple[PreparedImpact, Motion, int]:
        """Prepare a hit.

        Args:
            impact: What hits; its time counts from frame 0 of the clock.
            timeline: What the character would do without it.

        Returns:
            The impact for the simulation, the character's motion from the simulation's start on,
            and the frame of the clock at which the simulation starts.
        """
        fps = self.physics.fps
        first = 0
        if impact.time > _FROM_START_S:
            first = int(np.floor((impact.time - _LEAD_S) * fps))
        last = int(np.ceil((impact.time + _AFTER_S) * fps))
        whole = Motion(timeline.read(first, last - first), fps, self._name)
        due = replace(impact, time=impact.time - first / fps)
        prepared = prepare(due, whole, self.character, self.physics)
        base = whole.slice(prepared.start, len(whole))
        return replace(prepared, start=0), base, first + prepared.start

    def _expected(self) -> PoseTimeline:
        """What the character would do without a further hit."""
        hit = self.last_hit
        if self.phase is not Phase.PHYSICS or hit is None or hit.choice is None:
            return self._timeline
        # As if the choice were entered now, from the present pose.
        choice = hit.choice
        if choice.name == CARRY_ON:
            return self._carry_on_timeline(choice, self.pose, self.frame)
        reaction = PoseTimeline.of(choice.motion.poses, hit.exit - choice.entry)
        return reaction.placed_on(self.pose, self.frame)

    def _carry_on_timeline(self, choice: Choice, pose: FloatArray, frame: int) -> PoseTimeline:
        """The timeline at the time at which a choice enters it, placed on a pose at a frame."""
        assert self.last_hit is not None
        delay = self.last_hit.exit - (self.last_hit.start + choice.entry)
        return self._timeline.placed_on(pose, frame, delay)

    def _velocity(self) -> FloatArray:
        """The present velocity (45,), a row of `qvel`."""
        if self.phase is Phase.PHYSICS and self.last_hit is not None and self.last_hit.trace:
            return self.last_hit.trace.velocities[self.frame - self.last_hit.start]
        before = [] if self._before is None else [self._before[None]]
        near = np.concatenate([*before, self.planned(self.frame, 2)])
        return pose_velocities(near, self.physics.fps)[len(before)]
