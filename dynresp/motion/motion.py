"""A motion: a stack of poses with a frame rate, foot contacts and labels."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import JOINTS, POSE_SIZE, ROOT, ROOT_QUAT, Character, as_poses
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import MotionError

# Foot order everywhere: left, right.
FEET = ("left", "right")
_FPS_RANGE = (0.001, 10_000.0)
_MAX_DISTANCE = 100_000.0  # [m]


@dataclass(frozen=True)
class Label:
    """A name for a range of frames, such as a strategy or "T-pose".

    Attributes:
        name: What happens there.
        start: First frame.
        stop: One past the last frame.
    """

    name: str
    start: int
    stop: int


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses of one character at a constant frame rate.

    Arrays are read-only; methods return new motions.

    Attributes:
        poses: (frames, 59) rows of `qpos` (see `dynresp.motion.character`), quaternions w x y z,
            unit length and continuous in sign; metres, Z up.
        fps: Frames per second; frame k is at time k / fps.
        name: Where it comes from, for users to read.
        contacts: (frames, 2) whether the left and the right foot stand on the ground.
        labels: Named ranges of frames.

    Raises:
        MotionError: Wrong shapes, no frame, numbers that are not finite, a root farther than
            100 km from the origin, a frame rate or a label out of bounds.
    """

    poses: FloatArray
    fps: float
    name: str = ""
    contacts: npt.NDArray[np.bool_] = field(default=None)  # type: ignore[arg-type]
    labels: tuple[Label, ...] = ()

    def __post_init__(self) -> None:
        """Check, normalise and freeze the arrays."""
        poses = np.array(as_poses(self.poses))
        if len(poses) == 0:
            raise MotionError(f"motion {self.name!r} has no frame; at least one is needed")
        if not np.isfinite(poses).all():
            frame = int(np.argmin(np.isfinite(poses).all(axis=1)))
            raise MotionError(
                f"motion {self.name!r} has a number that is not finite (frame {frame})"
            )
        distance = float(np.max(np.abs(poses[:, ROOT])))
        if distance > _MAX_DISTANCE:
            raise MotionError(
                f"motion {self.name!r} goes {distance:g} m away; "
                f"its root must stay within {_MAX_DISTANCE:g} m of the origin"
            )
        _check_rate(self.fps)
        quaternions = poses[:, 3:].reshape(len(poses), -1, 4)
        quaternions = rotations.make_continuous(rotations.normalize(quaternions))
        poses[:, 3:] = quaternions.reshape(len(poses), POSE_SIZE - 3)
        contacts = self.contacts
        if contacts is None:
            contacts = np.zeros((len(poses), 2), dtype=bool)
        contacts = np.array(contacts, dtype=bool)
        if contacts.shape != (len(poses), 2):
            raise MotionError(f"contacts must be ({len(poses)}, 2), got {contacts.shape}")
        for label in self.labels:
            if not 0 <= label.start < label.stop <= len(poses):
                raise MotionError(
                    f"label {label.name!r} spans frames {label.start} to {label.stop}, "
                    f"but the motion has frames 0 to {len(poses)}"
                )
        poses.flags.writeable = False
        contacts.flags.writeable = False
        object.__setattr__(self, "poses", poses)
        object.__setattr__(self, "contacts", contacts)
        object.__setattr__(self, "fps", float(self.fps))
        object.__setattr__(self, "labels", tuple(self.labels))

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.poses)

    @property
    def duration(self) -> float:
        """Time from the first frame to the last [s]."""
        return (len(self) - 1) / self.fps

    @property
    def root_positions(self) -> FloatArray:
        """(frames, 3) where the pelvis is [m]."""
        return self.poses[:, ROOT]

    @property
    def root_quaternions(self) -> FloatArray:
        """(frames, 4) how the pelvis is turned, w x y z."""
        return self.poses[:, ROOT_QUAT]

    @property
    def joint_quaternions(self) -> FloatArray:
        """(frames, 13, 4) joint rotations, w x y z."""
        return self.poses[:, JOINTS].reshape(len(self), -1, 4)

    def slice(self, start: int, stop: int) -> Motion:
        """Frames start to stop (stop not included).

        Raises:
            MotionError: The range is empty or outside the motion.
        """
        if not 0 <= start < stop <= len(self):
            raise MotionError(
                f"frames {start} to {stop} of {self.name!r}: it has frames 0 to {len(self)}"
            )
        labels = tuple(
            Label(x.name, max(x.start, start) - start, min(x.stop, stop) - start)
            for x in self.labels
            if x.start < stop and x.stop > start
        )
        return replace(
            self, poses=self.poses[start:stop], contacts=self.contacts[start:stop], labels=labels
        )

    def sample(self, times: npt.ArrayLike) -> FloatArray:
        """Poses at any times: the root by straight lines, rotations by slerp.

        Args:
            times: (n,) [s]; before the start and after the end the end poses hold.

        Returns:
            (n, 59).
        """
        at = np.clip(np.asarray(times, dtype=np.float64) * self.fps, 0.0, len(self) - 1.0)
        # A time within rounding of a frame is that frame: resampling is then exact.
        at = np.where(np.abs(at - np.round(at)) < 1e-9, np.round(at), at)
        low = np.minimum(at.astype(np.intp), max(len(self) - 2, 0))
        high = np.minimum(low + 1, len(self) - 1)
        return interpolate(self.poses[low], self.poses[high], at - low)

    def resampled(self, fps: float) -> Motion:
        """The same motion at another frame rate (slerp); it may end up to a frame earlier.

        A label covers the time from its first frame to its last one's end, so labels that meet
        still do; one that falls between two frames drops out.

        Raises:
            MotionError: The frame rate is out of bounds.
        """
        _check_rate(fps)
        if fps == self.fps:
            return self
        count = int(self.duration * fps + 1e-6) + 1
        nearest = np.minimum(np.round(np.arange(count) * self.fps / fps), len(self) - 1).astype(int)
        scale = fps / self.fps
        labels = []
        for x in self.labels:
            # The first frames not before the label's ends; less a little for rounding.
            start, stop = (min(math.ceil(n * scale - 1e-6), count) for n in (x.start, x.stop))
            if start < stop:
                labels.append(Label(x.name, start, stop))
        return Motion(
            self.sample(np.arange(count) / fps),
            fps,
            self.name,
            self.contacts[nearest],
            tuple(labels),
        )

    def velocities(self) -> FloatArray:
        """Rows of `qvel` (frames, 45): central differences, one-sided at the two ends.

        Root linear velocity in the world [m/s], root angular velocity in the root's frame and
        joint angular velocities in the child's frame [rad/s].
        """
        return pose_velocities(self.poses, self.fps)

    def mirrored(self, character: Character) -> Motion:
        """Left for right, mirrored in the plane y = 0."""
        return replace(
            self,
            poses=character.mirror(self.poses),
            contacts=self.contacts[:, ::-1],
            name=f"{self.name} (mirrored)",
        )

    def moved(self, yaw: float, translation: npt.ArrayLike) -> Motion:
        """Turned about the world's vertical by yaw [rad], then shifted by (3,) [m]."""
        return replace(self, poses=move_poses(self.poses, yaw, translation))

    def placed(self, x: float = 0.0, y: float = 0.0, yaw: float = 0.0, frame: int = 0) -> Motion:
        """Moved on the ground so that at one frame the pelvis is over (x, y) [m], facing yaw [rad].

        Args:
            x: Where the pelvis is then [m].
            y: Where the pelvis is then [m].
            yaw: How it faces (`rotations.yaw_of`) [rad].
            frame: At which frame; -1 is the last.

        Raises:
            MotionError: There is no such frame.
        """
        if not -len(self) <= frame < len(self):
            raise MotionError(f"frame {frame} of {self.name!r}: it has frames 0 to {len(self) - 1}")
        pose = self.poses[frame]
        turn = yaw - float(rotations.yaw_of(pose[ROOT_QUAT]))
        now = rotations.rotate(rotations.from_yaw(turn), pose[ROOT])
        return self.moved(turn, (x - now[0], y - now[1], 0.0))


def _check_rate(fps: float) -> None:
    lowest, highest = _FPS_RANGE
    if not lowest <= fps <= highest:  # so that NaN fails, too
        raise MotionError(f"frame rate must be {lowest:g} to {highest:g} per second, got {fps}")


def move_poses(poses: FloatArray, yaw: float, translation: npt.ArrayLike) -> FloatArray:
    """Poses (frames, 59) turned about the world's vertical by yaw [rad], then shifted (3,) [m]."""
    turn = rotations.from_yaw(yaw)
    moved = np.array(poses)
    moved[:, ROOT] = rotations.rotate(turn, poses[:, ROOT]) + np.asarray(translation)
    moved[:, ROOT_QUAT] = rotations.multiply(turn, poses[:, ROOT_QUAT])
    return moved


def interpolate(a: FloatArray, b: FloatArray, t: npt.ArrayLike) -> FloatArray:
    """Poses between a and b (frames, 59): the root by straight lines, rotations by slerp.

    Args:
        a: Poses at t = 0.
        b: Poses at t = 1, as many.
        t: (frames,) or a number, 0 to 1.
    """
    weight = np.broadcast_to(np.asarray(t, dtype=np.float64), (len(a),))
    out = np.empty_like(a)
    out[:, ROOT] = a[:, ROOT] + weight[:, None] * (b[:, ROOT] - a[:, ROOT])
    qa, qb = (x[:, 3:].reshape(len(a), -1, 4) for x in (a, b))
    out[:, 3:] = rotations.slerp(qa, qb, weight[:, None]).reshape(len(a), -1)
    return out


def interpolate_with_velocities(
    a: FloatArray,
    b: FloatArray,
    velocities_a: FloatArray,
    velocities_b: FloatArray,
    t: npt.ArrayLike,
    seconds: float,
) -> FloatArray:
    """Poses between a and b that begin and end with given velocities: cubics.

    Where poses are far apart in time, straight lines and slerp would change speed only at the
    poses. Rotations go along cubics of rotation vectors from a, whose slope at b is the angular
    velocity to first order in how far they turn.

    Args:
        a: Poses at t = 0, (frames, 59).
        b: Poses at t = 1, as many.
        velocities_a: Rows of `qvel` (frames, 45) at a; see `Motion.velocities`.
        velocities_b: Those at b.
        t: (frames,) or a number, 0 to 1.
        seconds: Time from a to b [s].
    """
    s = np.broadcast_to(np.asarray(t, dtype=np.float64), (len(a),))[:, None]
    rise = (3.0 - 2.0 * s) * s * s
    begin, end = ((s - 2.0) * s + 1.0) * s * seconds, (s - 1.0) * s * s * seconds
    out = np.empty_like(a)
    out[:, ROOT] = (
        a[:, ROOT]
        + rise * (b[:, ROOT] - a[:, ROOT])
        + begin * velocities_a[:, ROOT]
        + end * velocities_b[:, ROOT]
    )
    qa, qb = (x[:, 3:].reshape(len(a), -1, 4) for x in (a, b))
    turn = rotations.to_rotation_vector(rotations.multiply(rotations.conjugate(qa), qb))
    rates = begin[..., None] * velocities_a[:, 3:].reshape(turn.shape)
    rates += end[..., None] * velocities_b[:, 3:].reshape(turn.shape)
    turned = rotations.from_rotation_vector(rise[..., None] * turn + rates)
    # Exactly a and b at the two ends.
    between = rotations.multiply(qa, turned)
    between = np.where(s[..., None] >= 1.0, qb, between)
    out[:, 3:] = between.reshape(len(a), -1)
    out[:, ROOT] = np.where(s >= 1.0, b[:, ROOT], out[:, ROOT])
    return out


def pose_velocities(poses: FloatArray, fps: float) -> FloatArray:
    """Rows of `qvel` (frames, 45) by central differences; see `Motion.velocities`."""
    frames = len(poses)
    before = np.maximum(np.arange(frames) - 1, 0)
    after = np.minimum(np.arange(frames) + 1, frames - 1)
    span = np.maximum(after - before, 1)[:, None] / fps
    q = poses[:, 3:].reshape(frames, -1, 4)
    turns = rotations.to_rotation_vector(
        rotations.multiply(rotations.conjugate(q[before]), q[after])
    )
    linear = (poses[after, ROOT] - poses[before, ROOT]) / span
    return np.concatenate([linear, turns.reshape(frames, -1) / span], axis=1)
