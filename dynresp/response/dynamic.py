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
from dynresp.physics.impacts import Impact, PreparedImpact, prepare
from dynresp.physics.scene import PhysicsConfig
from dynresp.physics.trace import Setup, Trace
from dynresp.response.choice import Choice
from dynresp.response.transition import place_on

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
        due: The first frame at or after the moment at which it is due.
    """

    impact: Impact
    launch: int
    due: int


@dataclass
class Flight:
    """A hit that is being simulated.

    Attributes:
        launch: When its simulation began.
        setup: Where it began from.
        base: What the character would do without it, from the launch on.
        trace: The simulation up to the exit, once it is chosen when to leave it.
        choice: What was chosen.
        exit: When the simulation is left.
    """

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
        self._shown = [base.poses[0]]
        self._invoked: list[Invoked] = []

    @property
    def pose(self) -> FloatArray:
        """(59,) what it shows now."""
        return self._shown[-1]

    @property
    def shown(self) -> Motion:
        """Everything that it has shown so far."""
        return Motion(np.stack(self._shown), self.physics.fps, self._name)

    def hit(self, impact: Impact) -> None:
        """Let something hit it.

        Args:
            impact: What; its time counts from now. A ball needs time to fly there, a push none.

        Raises:
            SpecError: It comes too soon, or while something else is on its way.
        """
        fps = self.physics.fps
        asked = replace(impact, time=impact.time + self.frame / fps)
        _, _, launch = self._prepared(asked)
        if launch < self.frame:
            raise SpecError(
                f"time: the impact is due {impact.time:g} s from now and needs "
                f"{impact.time + (self.frame - launch) / fps:.2f} s to come"
            )
        new = Invoked(asked, launch, int(np.ceil(asked.time * fps)))
        for other in self._on_their_way():
            if new.launch <= other.due and other.launch <= new.due:
                raise SpecError(
                    f"time: something else is on its way until "
                    f"{(other.due - self.frame) / self.physics.fps:.2f} s from now, and this would "
                    f"be from {(new.launch - self.frame) / self.physics.fps:.2f} s on; one thing "
                    "at a time can come"
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
        self.flight = Flight(self.frame, setup, base)
        self.phase = Phase.APPROACH
        self.tell(EventKind.INVOKED)
        return self.flight

    def tell(self, kind: EventKind, frame: int | None = None, choice: Choice | None = None) -> None:
        """Note an event, now unless said otherwise."""
        self.events.append(Event(kind, self.frame if frame is None else frame, choice))

    def show(self, pose: FloatArray) -> None:
        """Show a pose at the next frame of the clock."""
        self.frame += 1
        self._shown.append(pose)

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
        return [invoked for invoked in self._invoked if invoked.due >= self.frame]

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
        until = max(self.frame + needed, self._plan_from + len(self._plan))
        return self.planned(self._plan_from, until - self._plan_from), self._plan_from

    def _velocity(self) -> FloatArray:
        """How it moves now (45,)."""
        if self.phase is Phase.PHYSICS and self.flight is not None and self.flight.trace:
            return self.flight.trace.velocities[self.frame - self.flight.launch]
        before = self._shown[-2:-1]
        near = np.concatenate([*(pose[None] for pose in before), self.planned(self.frame, 2)])
        return pose_velocities(near, self.physics.fps)[len(before)]
