"""What goes into a simulation and what comes out of it."""

from __future__ import annotations

from dataclasses import dataclass

from dynresp.motion.rotations import FloatArray
from dynresp.physics.prepared_impact import PreparedImpact


@dataclass(frozen=True)
class Setup:
    """One simulation to be.

    Attributes:
        base: (frames, 59) the base motion from the simulation's first frame on, at its frame
            rate. After its last frame the last pose holds.
        impact: What hits.
        velocity: (45,) the base motion's velocity at that frame, a row of `qvel`; None takes it
            from the first two frames of `base`.
        pose: (59,) where the character is at the start, if that is not where `base` begins.
        held: Whether its pelvis is held to the base motion until contact. A character that has
            just been hit is not: the simulation takes over from where it is.
    """

    base: FloatArray
    impact: PreparedImpact
    velocity: FloatArray | None = None
    pose: FloatArray | None = None
    held: bool = True


@dataclass(frozen=True)
class Contact:
    """The first contact between impactor and character.

    Attributes:
        time_s: Since the simulation's first frame [s].
        frame: First frame at or after the contact.
        body: Name of the body that was hit.
        force: Contact force in the step of contact [N]; of a push, its peak.
        point: (3,) where [m], world; of a push, the body's centre of mass at the frame before.
    """

    time_s: float
    frame: int
    body: str
    force: float
    point: tuple[float, float, float]


@dataclass(frozen=True)
class Divergence:
    """A simulation that blew up.

    Attributes:
        frame: Frame in which it did.
        warning: MuJoCo's name for what went wrong.
    """

    frame: int
    warning: str


@dataclass(frozen=True)
class Trace:
    """What one simulation did, frame by frame.

    Attributes:
        poses: (frames, 59); frame 0 is the setup's first frame.
        velocities: (frames, 45) rows of `qvel`.
        impactor: (frames, 7) pose of the ball, fist or striking arm; None for a push.
        contact: The first contact; None where the impact missed.
        diverged: Set where the simulation blew up; the frames are those before it.
    """

    poses: FloatArray
    velocities: FloatArray
    impactor: FloatArray | None
    contact: Contact | None
    diverged: Divergence | None
