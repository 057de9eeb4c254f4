"""The recorded frames of a motion graph, clip by clip (Lee et al. 2002, section 3)."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph import placement
from dynresp.motion.character import POSE_SIZE, VELOCITY_SIZE, Character
from dynresp.motion.motion import Motion, pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray, IntArray, frozen
from dynresp.support.errors import MotionError

CONTACTS = ("left foot", "right foot", "left hand", "right hand")
"""Columns of contacts; a database has the first two, or all four."""
# For each column the one that it becomes when mirrored.
_MIRRORED = [1, 0, 3, 2]


@dataclass(frozen=True)
class Clip:
    """Frames that were recorded one after the other.

    Attributes:
        name: Name of the motion.
        start: Its first frame in the database.
        stop: One past its last frame.
        identity: Short hash of the motion's poses, contacts and frame rate; see `motion_identity`.
    """

    name: str
    start: int
    stop: int
    identity: str


@dataclass(frozen=True, eq=False)
class MotionDatabase:
    """Clips of one character at one frame rate, one after the other. Arrays are read-only.

    Attributes:
        poses: (n, 59) rows of `qpos`, each clip in its own world; w x y z, metres, Z up.
        contacts: (n, 2 or 4) which feet, and hands, touch the environment; see `CONTACTS`.
        fps: Frames per second.
        clips: The clips, in the order of their frames.
        character: `Character.identity` of the character.
        credits: Credits of the motions, a line each.
        world: Name of the world in which they were recorded; "flat" is level ground.

    Raises:
        MotionError: Shapes do not match, or there is no frame.
    """

    poses: FloatArray
    contacts: BoolArray
    fps: float
    clips: tuple[Clip, ...]
    character: str
    credits: tuple[str, ...] = ()
    world: str = "flat"

    def __post_init__(self) -> None:
        """Check and freeze the arrays."""
        poses = np.array(self.poses, dtype=np.float64)
        contacts = np.array(self.contacts, dtype=bool)
        if poses.ndim != 2 or poses.shape[1] != POSE_SIZE or len(poses) == 0:
            raise MotionError(f"poses must be (frames, {POSE_SIZE}), got {poses.shape}")
        if contacts.shape not in ((len(poses), 2), (len(poses), 4)):
            raise MotionError(
                f"contacts must be ({len(poses)}, 2) or ({len(poses)}, 4), got {contacts.shape}"
            )
        edges = [0, *(clip.stop for clip in self.clips)]
        if [clip.start for clip in self.clips] != edges[:-1] or edges[-1] != len(poses):
            raise MotionError(f"clips must follow each other and cover all {len(poses)} frames")
        for name, array in (("poses", poses), ("contacts", contacts)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @classmethod
    def from_motions(
        cls,
        motions: Sequence[Motion],
        character: Character,
        fps: float = 15.0,
        mirrored: bool = False,
        contacts: Sequence[BoolArray] | None = None,
        credit_lines: tuple[str, ...] = (),
    ) -> MotionDatabase:
        """Resample motions to one frame rate and join them.

        A motion given twice is used once: jumps to its copy would change nothing. Motions shorter
        than three frames are left out.

        Args:
            motions: The motions, at any frame rate.
            character: The character of the motions.
            fps: Frame rate of the database; the paper's is 15 (section 6).
            mirrored: Whether every motion is followed by its mirror image.
            contacts: For each motion (frames, 2 or 4) which feet, and hands, touch the
                environment, at the motion's own rate; by default the motions' foot contacts.
            credit_lines: `credits` of the database.

        Raises:
            MotionError: An item is no motion, or no motion is long enough.
        """
        listed = isinstance(motions, Sequence)
        if not listed or not all(isinstance(motion, Motion) for motion in motions):
            raise MotionError(
                f"a motion database is made of a list of Motion objects, got {motions!r:.60}; "
                "files are read by dynresp.motion.load.load_motion"
            )
        given = [m.contacts for m in motions] if contacts is None else list(contacts)
        if len(given) != len(motions) or any(
            len(c) != len(m) for c, m in zip(given, motions, strict=True)
        ):
            raise MotionError("contacts must be given for every frame of every motion")
        poses: list[FloatArray] = []
        flags: list[BoolArray] = []
        clips: list[Clip] = []
        seen: set[str] = set()
        for motion, touching in zip(motions, given, strict=True):
            identity = motion_identity(motion, touching)
            if identity in seen:
                continue
            seen.add(identity)
            at_rate = motion.resampled(fps)
            nearest = np.round(np.arange(len(at_rate)) * motion.fps / fps).astype(int)
            kept = np.asarray(touching, dtype=bool)[np.minimum(nearest, len(motion) - 1)]
            versions = [(at_rate, kept, identity)]
            if mirrored:
                swapped = kept[:, _MIRRORED[: kept.shape[1]]]
                versions.append((at_rate.mirrored(character), swapped, f"{identity}m"))
            for version, its_contacts, its_identity in versions:
                if len(version) < 3:
                    continue
                start = clips[-1].stop if clips else 0
                clips.append(Clip(version.name, start, start + len(version), its_identity))
                poses.append(version.poses)
                flags.append(its_contacts)
        if not clips:
            raise MotionError(
                f"a motion database needs a motion of at least three frames at {fps:g} fps; "
                f"{len(motions)} motions were given, none so long"
            )
        return cls(
            np.concatenate(poses),
            np.concatenate(flags),
            fps,
            tuple(clips),
            character.identity,
            credit_lines,
        )

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.poses)

    @functools.cached_property
    def velocities(self) -> FloatArray:
        """(n, 45) rows of `qvel`, central differences inside each clip; see `Motion`."""
        out = np.empty((len(self), VELOCITY_SIZE))
        for clip in self.clips:
            out[clip.start : clip.stop] = pose_velocities(
                self.poses[clip.start : clip.stop], self.fps
            )
        return frozen(out)

    @functools.cached_property
    def planar(self) -> FloatArray:
        """(n, 4) position [m] and yaw [rad] of the root, frame by frame."""
        return frozen(placement.of_poses(self.poses))

    @functools.cached_property
    def clip_of(self) -> IntArray:
        """(n,) index of each frame's clip."""
        lengths = [clip.stop - clip.start for clip in self.clips]
        return frozen(np.repeat(np.arange(len(self.clips), dtype=np.int32), lengths))

    @functools.cached_property
    def successors(self) -> IntArray:
        """(n,) the frame recorded after each, -1 at the end of a clip."""
        following = np.arange(1, len(self) + 1, dtype=np.int32)
        following[[clip.stop - 1 for clip in self.clips]] = -1
        return frozen(following)

    @functools.cached_property
    def contact_states(self) -> npt.NDArray[np.uint8]:
        """(n,) contacts as one number: bit k is set where `contacts[:, k]` is."""
        bits = np.left_shift(1, np.arange(self.contacts.shape[1]))
        return frozen((self.contacts @ bits).astype(np.uint8))

    def motion(self, clip: int) -> Motion:
        """A clip as a motion, in its own world."""
        it = self.clips[clip]
        part = slice(it.start, it.stop)
        return Motion(self.poses[part], self.fps, it.name, self.contacts[part, :2])


def motion_identity(motion: Motion, contacts: BoolArray) -> str:
    """Short hash of a motion's poses, contacts and frame rate.

    Poses are rounded to a nanometre: reading a file may differ in the last bits from machine to
    machine.
    """
    rounded = (np.round(motion.poses, 9) + 0.0).astype("<f8")
    content = (rounded.tobytes(), np.packbits(contacts).tobytes(), f"{motion.fps:.9g}".encode())
    return hashlib.sha256(b"|".join(content)).hexdigest()[:16]
