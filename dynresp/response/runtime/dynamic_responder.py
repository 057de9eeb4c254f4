"""A character at run time: it plays a motion, is hit, and goes on (Zordan et al. 2007, figure 2).

Frames count on the character's clock, which runs at the simulation's rate and is 0 when it begins.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion, pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import WAIT_S, Impact, PreparedImpact, Push, prepare
from dynresp.physics.scene import PhysicsConfig
from dynresp.physics.trace import Setup, Trace
from dynresp.response.choice import Choice
from dynresp.response.response import CARRY_ON
from dynresp.response.transition.pose_timeline import Plan
from dynresp.support.errors import MotionError, SpecError

# Times of a hit count from frame 0 as long as it is due before this [s], so that they are rounded
# as by `Responder`; later from shortly before it is due, since a character may play for hours.
_FROM_START_S = 10.0
# That is more than any impact needs to come [s] (`dynresp.physics.impacts.flight_s`).
_COMING_S = 1.0
# Latest time from now at which a hit can be asked for [s].
_LATEST_S = 60.0
# How much of what it would do a hit is prepared with, beyond the time at which it is due [s]: the
# longest look-ahead, with room for the blend.
_BEYOND_S = 5.0
# So many events are remembered: those of at least a hundred hits.
_EVENTS = 600


class Phase(Enum):
    """What moves a character."""

    PLAYING = "playing"
    """A motion: the base motion, or a reaction after its blend."""
    APPROACH = "approach"
    """The simulation, while something is on its way to it."""
    PHYSICS = "physics"
    """The simulation, after contact."""
    BLEND = "blend"
    """The blend from the simulation to what was chosen."""


class EventKind(Enum):
    """The events of the paper's figure 2, and what can happen instead."""

    INVOKED = "invoked"
    """1: something is on its way; the simulation begins."""
    CONTACT = "contact"
    """2: it hits."""
    CHOSEN = "chosen"
    """3: looked ahead, chosen, aligned."""
    REWOUND = "rewound"
    """4: the simulation is taken back."""
    BLEND_BEGUN = "blend begun"
    """5: the simulation is left, the final blend begins."""
    BLEND_ENDED = "blend ended"
    """6: what was chosen goes on alone."""
    MISSED = "missed"
    """Nothing was hit: it goes back to what it did."""
    DIVERGED = "diverged"
    """The simulation blew up: it goes back to what it did."""


@dataclass(frozen=True)
class Event:
    """Something that happened to a character.

    Attributes:
        kind: What.
        frame: When.
        choice: How it goes on, of `EventKind.CHOSEN`.
    """

    kind: EventKind
    frame: int
    choice: Choice | None = None


@dataclass(frozen=True)
class Invoked:
    """A hit that was asked for and has not begun.

    Attributes:
        impact: What hits; its time counts from frame 0.
        launch: When its simulation begins.
        until: The last frame at which it may still hit.
    """

    impact: Impact
    launch: int
    until: int


@dataclass
class Flight:
    """A hit that is being simulated.

    Attributes:
        invoked: What was asked for.
        launch: When its simulation began.
        setup: Where it began from, and what it tracks.
        base: What the character would do without it, from the launch on, for some seconds.
        trace: What was simulated, once it is chosen when to leave it: at least to the exit.
        choice: What was chosen.
        exit: When the simulation is left.
        end: When the blend has ended.
    """

    invoked: Invoked
    launch: int
    setup: Setup
    base: Motion
    trace: Trace | None = None
    choice: Choice | None = None
    exit: int = 0
    end: int = 0


class DynamicResponder:
    """A character of a `Crowd`, which advances it.

    Attributes:
        character: Its body.
        physics: How it is simulated.
        frame: What its clock shows.
        pose: (59,) what it shows itself.
        phase: What moves it.
        events: What happened to it last, in order: the events of a hundred hits at least.
        flight: The last hit that was simulated, None before the first.
        takeovers: How often what it plays was replaced or moved otherwise than by `play`: by a
            reaction, by a hit that is carried on through, after a miss from where it stood.
    """

    def __init__(self, base: Motion, character: Character, physics: PhysicsConfig) -> None:
        """Begin with the first frame of a motion; after its last frame the last pose holds."""
        self.character = character
        self.physics = physics
        self.frame = 0
        self.phase = Phase.PLAYING
        self.events: deque[Event] = deque(maxlen=_EVENTS)
        self.flight: Flight | None = None
        self.takeovers = 0
        self._plan = Plan.of(base.poses, 0)
        self._name = base.name
        self.pose = base.poses[0]
        self._before: FloatArray | None = None
        self._invoked: list[Invoked] = []

    @property
    def free_from(self) -> int | None:
        """First frame from which `play` is allowed: the next, or the end of the blend.

        None while it is simulated after a contact: what it goes on with is not laid yet.
        """
        if self.phase is Phase.PHYSICS:
            return None
        if self.phase is Phase.BLEND and self.flight is not None:
            return max(self.flight.end, self.frame + 1)
        return self.frame + 1

    @property
    def planned_until(self) -> int:
        """One past the last frame for which there is a pose to play; from there on that holds."""
        return self._plan.end

    def planned(self, first: int, frames: int) -> FloatArray:
        """(frames, 59) what it plays from a frame on, now or later, unless something hits it.

        While it is simulated after a contact, that is what it would have played without.
        """
        return self._plan.read(first, frames)

    def play(self, motion: Motion, first: int | None = None) -> None:
        """Play a motion from a frame on, in place of all that was to come.

        Nothing is blended: the motion is to go on from what `planned` says for the frame before.
        So one who plans endlessly gives it piece by piece; what is past is forgotten. The motion is
        played as any other: it is tracked while something approaches, gone back to after a miss,
        and moved on the ground with the rest where a hit is carried on through. A reaction takes
        its place.

        Args:
            motion: What, where it is in the world; after its last frame that pose holds.
            first: The frame of the clock at which its first frame is due, by default `free_from`.

        Raises:
            SpecError: The frame is over, or the character is not free then.
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
                "a character that was hit plays nothing before its blend has begun; ask when "
                "`free_from` tells a frame"
            )
        if first is None:
            first = free
        if first < free:
            raise SpecError(f"first: the character is free from frame {free} on, got {first}")
        flight = self.flight if self.phase is Phase.APPROACH else None
        since = self.frame if flight is None else flight.launch
        self._plan = self._plan.since(since).laid(motion.poses, first)
        self._name = motion.name
        if flight is not None:
            flight.base = Motion(self.planned(flight.launch, len(flight.base)), fps, self._name)
            flight.setup = replace(flight.setup, base=flight.base.poses)

    def hit(self, impact: Impact) -> None:
        """Let something hit it.

        Args:
            impact: What; its time counts from now. A ball needs time to fly there, a push none.

        Raises:
            SpecError: It comes too soon or too late, or while something else is on its way.
        """
        fps = self.physics.fps
        if not impact.time <= _LATEST_S:
            raise SpecError(f"time must be at most {_LATEST_S:g} s from now, got {impact.time:g}")
        asked = replace(impact, time=impact.time + self.frame / fps)
        _, _, launch = self._prepared(asked, self._ahead())
        if launch < self.frame:
            raise SpecError(
                f"time: the impact is due {impact.time:g} s from now and needs "
                f"{impact.time + (self.frame - launch) / fps:.2f} s to come"
            )
        wait_s = 0.0 if isinstance(impact, Push) else WAIT_S
        new = Invoked(asked, launch, int(np.ceil((asked.time + wait_s) * fps)))
        for other in self._on_their_way():
            if new.launch <= other.until and other.launch <= new.until:
                raise SpecError(
                    f"time: something else may hit until {(other.until - self.frame) / fps:.2f} s "
                    f"from now, and this would be on its way from "
                    f"{(new.launch - self.frame) / fps:.2f} s on; one thing at a time can come"
                )
        self._invoked.append(new)

    # -- for the crowd --------------------------------------------------------------------------

    def launch(self) -> Flight | None:
        """Begin to simulate the hit whose time has come, if there is one."""
        coming = [invoked for invoked in self._invoked if invoked.launch <= self.frame]
        if not coming:
            return None
        self._invoked.remove(coming[0])
        impact = coming[0].impact
        if self.phase is Phase.PHYSICS:
            self._plan = self._ahead()
            self.takeovers += 1
        prepared, base, _ = self._prepared(impact, self._plan)
        playing = self.phase is Phase.PLAYING
        setup = Setup(
            base.poses,
            prepared,
            velocity=self._velocity(),
            pose=None if playing else self.pose,
            held=playing,
        )
        self.flight = Flight(coming[0], self.frame, setup, base)
        self.phase = Phase.APPROACH
        self.tell(EventKind.INVOKED)
        return self.flight

    def tell(self, kind: EventKind, frame: int | None = None, choice: Choice | None = None) -> None:
        """Note an event, now unless said otherwise."""
        self.events.append(Event(kind, self.frame if frame is None else frame, choice))

    def show(self, pose: FloatArray) -> None:
        """Show a pose at the next frame of the clock."""
        self.frame += 1
        self._before, self.pose = self.pose, pose

    def enter(self, choice: Choice, simulated: FloatArray, poses: FloatArray) -> None:
        """Leave the simulation for what was chosen.

        Args:
            choice: What.
            simulated: (59,) where the simulation is at the exit.
            poses: (frames, 59) from there on, the blend first.
        """
        assert self.flight is not None
        plan = Plan.of(poses, self.flight.exit)
        if choice.name == CARRY_ON:
            # After the poses it is the plan that goes on, however long.
            plan = self._carried_on(choice, simulated, self.flight.exit)
            plan = plan.patched(poses, self.flight.exit)
        self._plan = plan.since(self.flight.exit)
        self.takeovers += 1
        self.phase = Phase.BLEND

    def go_back(self, onto: FloatArray | None, poses: FloatArray) -> None:
        """Leave the simulation for what was planned.

        Args:
            onto: (59,) where the plan is moved to; None leaves it where it is.
            poses: (frames, 59) the blend, from now on.
        """
        assert self.flight is not None
        plan = self._plan
        if onto is not None:
            plan = plan.placed_on(onto, self.frame)
            self.takeovers += 1
        self._plan = plan.patched(poses, self.frame).since(self.frame)
        self.phase = Phase.BLEND

    # -- what it would do -----------------------------------------------------------------------

    def _on_their_way(self) -> list[Invoked]:
        """What was asked for and has neither hit nor missed."""
        if self.phase is Phase.APPROACH and self.flight is not None:
            return [self.flight.invoked, *self._invoked]
        return self._invoked

    def _prepared(self, impact: Impact, plan: Plan) -> tuple[PreparedImpact, Motion, int]:
        """A hit made ready: for the simulation, what the character would do, and when it begins.

        Args:
            impact: Its time is that of the character's clock.
            plan: What the character would do.
        """
        fps = self.physics.fps
        first = 0
        if impact.time > _FROM_START_S:
            first = int(np.floor((impact.time - _COMING_S) * fps))
        last = int(np.ceil((impact.time + _BEYOND_S) * fps))
        whole = Motion(plan.read(first, last - first), fps, self._name)
        due = replace(impact, time=impact.time - first / fps)
        prepared = prepare(due, whole, self.character, self.physics)
        base = whole.slice(prepared.start, len(whole))
        return replace(prepared, start=0), base, first + prepared.start

    def _ahead(self) -> Plan:
        """What it would do without a further hit."""
        flight = self.flight
        if self.phase is not Phase.PHYSICS or flight is None or flight.choice is None:
            return self._plan
        # What was chosen, as if it were entered by the clock from where the character is.
        choice = flight.choice
        if choice.name == CARRY_ON:
            return self._carried_on(choice, self.pose, self.frame)
        reaction = Plan.of(choice.motion.poses, flight.exit - choice.entry)
        return reaction.placed_on(self.pose, self.frame)

    def _carried_on(self, choice: Choice, pose: FloatArray, frame: int) -> Plan:
        """The plan gone on with by the clock of a choice, from where a pose is at a frame."""
        assert self.flight is not None
        later = self.flight.exit - (self.flight.launch + choice.entry)
        return self._plan.placed_on(pose, frame, later)

    def _velocity(self) -> FloatArray:
        """How it moves now (45,)."""
        if self.phase is Phase.PHYSICS and self.flight is not None and self.flight.trace:
            return self.flight.trace.velocities[self.frame - self.flight.launch]
        before = [] if self._before is None else [self._before[None]]
        near = np.concatenate([*before, self.planned(self.frame, 2)])
        return pose_velocities(near, self.physics.fps)[len(before)]
