"""A character at run time: it plays a motion, is hit, and goes on (Zordan et al. 2007, figure 2).

Frames count on the character's clock, which runs at the simulation's rate and is 0 when it begins.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from dynresp.errors import SpecError
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion, pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import WAIT_S, Impact, PreparedImpact, Push, prepare
from dynresp.physics.scene import PhysicsConfig
from dynresp.physics.trace import Setup, Trace
from dynresp.response.choice import Choice
from dynresp.response.transition import place_on

# Times of a hit count from where the plan began, as long as that is less than this ago [s]: what is
# past is of no use, and a character may play for hours.
_REMEMBERED_S = 10.0
# Latest time from now at which a hit can be asked for [s].
_LATEST_S = 60.0
# How much of what it would do a hit is prepared with, beyond the time at which it is due [s]: the
# longest look-ahead, with room for the blend.
_BEYOND_S = 5.0


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
        setup: Where it began from.
        base: What the character would do without it, from the launch on.
        trace: What was simulated, once it is chosen when to leave it: at least to the exit.
        choice: What was chosen.
        exit: When the simulation is left.
    """

    invoked: Invoked
    launch: int
    setup: Setup
    base: Motion
    trace: Trace | None = None
    choice: Choice | None = None
    exit: int = 0


class DynamicResponder:
    """A character of a `Crowd`, which advances it.

    Attributes:
        character: Its body.
        physics: How it is simulated.
        frame: What its clock shows.
        pose: (59,) what it shows itself.
        phase: What moves it.
        events: What happened to it, in order.
        flight: The last hit that was simulated, None before the first.
    """

    def __init__(self, base: Motion, character: Character, physics: PhysicsConfig) -> None:
        """Begin with the first frame of a motion; after its last frame the last pose holds."""
        self.character = character
        self.physics = physics
        self.frame = 0
        self.phase = Phase.PLAYING
        self.events: list[Event] = []
        self.flight: Flight | None = None
        self._plan = base.poses
        self._plan_from = 0
        self._name = base.name
        self.pose = base.poses[0]
        self._before: FloatArray | None = None
        self._invoked: list[Invoked] = []

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
        _, _, launch = self._prepared(asked)
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
        prepared, base, _ = self._prepared(impact)
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

    def plan(self, poses: FloatArray, first: int) -> None:
        """Set what it plays.

        Args:
            poses: (frames, 59); after the last the last holds.
            first: When the first of them is due.
        """
        self._plan, self._plan_from = poses, first

    def planned(self, first: int, frames: int) -> FloatArray:
        """(frames, 59) what it plays from a frame on."""
        at = np.arange(first, first + frames) - self._plan_from
        return self._plan[np.clip(at, 0, len(self._plan) - 1)]

    # -- what it would do -----------------------------------------------------------------------

    def _on_their_way(self) -> list[Invoked]:
        """What was asked for and has neither hit nor missed."""
        if self.phase is Phase.APPROACH and self.flight is not None:
            return [self.flight.invoked, *self._invoked]
        return self._invoked

    def _prepared(self, impact: Impact) -> tuple[PreparedImpact, Motion, int]:
        """A hit made ready: for the simulation, what the character would do, and when it begins.

        Args:
            impact: Its time is that of the character's clock.
        """
        fps = self.physics.fps
        last = int(np.ceil((impact.time + _BEYOND_S) * fps))
        poses, first = self._ahead(max(last - self.frame, 1))
        whole = Motion(poses, fps, self._name)
        due = replace(impact, time=impact.time - first / fps)
        prepared = prepare(due, whole, self.character, self.physics)
        base = whole.slice(prepared.start, len(whole)) if prepared.start else whole
        return replace(prepared, start=0), base, first + prepared.start

    def _ahead(self, needed: int) -> tuple[FloatArray, int]:
        """What it would do without a further hit, for at least so many frames from now.

        Returns:
            Poses (frames, 59), and when the first of them is due: now or before.
        """
        flight = self.flight
        if self.phase is Phase.PHYSICS and flight is not None and flight.choice is not None:
            # What was chosen, as if it were entered by the clock from where the character is.
            entry = flight.choice.entry - (flight.exit - self.frame)
            poses = flight.choice.motion.poses
            frames = max(needed, len(poses) - entry)
            at = np.clip(entry + np.arange(frames), 0, len(poses) - 1)
            return place_on(poses[at], 0, self.pose), self.frame
        first = self._plan_from
        if self.frame - first > _REMEMBERED_S * self.physics.fps:
            first = self.frame
        until = max(self.frame + needed, self._plan_from + len(self._plan))
        return self.planned(first, until - first), first

    def _velocity(self) -> FloatArray:
        """How it moves now (45,)."""
        if self.phase is Phase.PHYSICS and self.flight is not None and self.flight.trace:
            return self.flight.trace.velocities[self.frame - self.flight.launch]
        before = [] if self._before is None else [self._before[None]]
        near = np.concatenate([*before, self.planned(self.frame, 2)])
        return pose_velocities(near, self.physics.fps)[len(before)]
