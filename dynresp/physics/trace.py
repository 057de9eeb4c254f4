"""What goes into a simulation (`Setup`) and what comes out of it (`Trace`)."""

from __future__ import annotations

from dataclasses import dataclass

from dynresp.motion.rotations import FloatArray
from dynresp.physics.prepared_impact import PreparedImpact


@dataclass(frozen=True)
class Setup:
    """What one simulation starts from and tracks.

    Attributes:
        base: (frames, 59) the base motion from the simulation's first frame on, at the simulation's
            frame rate. After its last frame the last pose holds.
        impact: What hits.
        velocity: (45,) velocity at the first frame, a row of `qvel`; None takes it from the first
            two frames of `base`.
        pose: (59,) pose at the first frame; None takes the first of `base`.
        held: Whether the pelvis is held to the base motion until contact. False for a character
            that has just been hit: it starts from where it is.
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
        time_s: Time from the simulation's first frame [s].
        frame: First frame at or after the contact.
        body: Name of the body that was hit.
        force: Contact force in the step of contact [N]; for a push, its peak.
        point: (3,) position [m], world; for a push, the body's centre of mass at the frame before.
    """

    time_s: float
    frame: int
    body: str
    force: float
    point: tuple[float, float, float]


@dataclass(frozen=True)
class Divergence:
    """Where a simulation became unstable.

    Attributes:
        frame: Frame in which it did.
        warning: MuJoCo's name of the warning, such as "BADQACC".
    """

    frame: int
    warning: str


@dataclass(frozen=True)
class Trace:
    """The result of one simulation, frame by frame.

    Attributes:
        poses: (frames, 59) poses; frame 0 is the setup's first frame.
        velocities: (frames, 45) rows of `qvel`.
        impactor: (frames, 7) position [m] and quaternion w x y z of the ball, fist or striking arm;
            None for a push.
        contact: The first contact; None if the impact missed.
        diverged: Where the simulation became unstable; None if it did not. The frames end before.
    """

    poses: FloatArray
    velocities: FloatArray
    impactor: FloatArray | None
    contact: Contact | None
    diverged: Divergence | None
