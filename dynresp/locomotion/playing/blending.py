"""Play frames of a graph as one continuous motion: displacement mapping (section 4.1.1).

After a jump from frame i to frame j the recorded motion is displaced so that pose and velocity at
frame j - 1 are those played at frame i. The displacement decays to zero over the blend; the part
that comes from the difference in velocity decays over a shorter time. The pose played at i includes
what remains of earlier displacements, so blends may overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.motion_graph import MotionGraph, placements_between
from dynresp.locomotion.graph.placement import IDENTITY, of_poses, place_poses, place_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray, IntArray
from dynresp.support.errors import MotionError


@dataclass(frozen=True, eq=False)
class Played:
    """A piece of played motion.

    Attributes:
        frames: (k,) the frames of the database.
        poses: (k, 59) as played, in the world.
        contacts: (k, 2 or 4) of the frames.
        jumps: (k,) whether a frame was reached by a jump.
        placements: (k, 4) of each frame's clip: the recorded pose, so placed, was displaced.
        velocities: (k, 45) velocities of the poses.
    """

    frames: IntArray
    poses: FloatArray
    contacts: BoolArray
    jumps: BoolArray
    placements: FloatArray
    velocities: FloatArray


class Playback:
    """Plays frames of a graph; each call continues where the last one ended.

    Attributes:
        graph: The graph.
        frame: The frame played last.
        placement: (4,) of its clip.
    """

    def __init__(self, graph: MotionGraph, frame: int, placement: npt.ArrayLike = IDENTITY) -> None:
        """Start after a frame that was played as it was recorded.

        Args:
            graph: The graph.
            frame: A frame of the graph's database.
            placement: (4,) of its clip.
        """
        self.graph = graph
        self.frame = frame
        self.placement = np.array(placement, dtype=np.float64)
        self._offset, self._rate = np.zeros(45), np.zeros(45)
        self._age = np.array([graph.config.blend_s])

    @classmethod
    def entering(
        cls, graph: MotionGraph, frame: int, pose: FloatArray, velocity: FloatArray
    ) -> Playback:
        """Start after any pose: the motion recorded after a frame is blended to it.

        Args:
            graph: The graph.
            frame: The frame that resembles the pose. The frame recorded after it is played next.
            pose: (59,) the pose played last, in the world.
            velocity: (45,) its velocity.
        """
        from dynresp.locomotion.playing.blending_kernel import displacement_kernel

        database = graph.database
        planar = of_poses(pose[None])
        matched = database.planar[frame : frame + 1]
        playback = cls(graph, frame, placements_between(planar, matched, graph.config)[0])
        displacement_kernel(
            np.ascontiguousarray(pose), np.ascontiguousarray(velocity), playback.placement,
            database.poses[frame], database.velocities[frame], playback._offset, playback._rate,
        )  # fmt: skip
        playback._age[0] = 0.0
        return playback

    @property
    def displacement(self) -> FloatArray:
        """(91,) what remains of blends after the frame played last.

        The displacement at the last jump (45) [m, rad], its rate of change then (45) [m/s, rad/s],
        and the time since [s]; see `blending_kernel.Blend`.
        """
        return np.concatenate([self._offset, self._rate, self._age])

    def play(self, frames: npt.ArrayLike) -> Played:
        """Play the next frames.

        Args:
            frames: (k,) frames; each is the one recorded after the frame before, or a jump.

        Raises:
            MotionError: A jump leads to the first frame of a clip, which has no frame before it.
        """
        from dynresp.locomotion.playing import blending_kernel as kernel

        database, config = self.graph.database, self.graph.config
        path = np.concatenate([[self.frame], np.asarray(frames)]).astype(np.int32)
        left, entered = path[:-1], path[1:]
        jumps = database.successors[left] != entered
        first = (entered == 0) | (database.clip_of[entered] != database.clip_of[entered - 1])
        if (jumps & first).any():
            frame = int(entered[np.argmax(jumps & first)])
            raise MotionError(f"no jump can lead to frame {frame}, the first of its clip")
        moves = self.graph.placements_between(left, entered)
        rows = kernel.PlayedRows(*(np.empty((len(entered), size)) for size in (59, 4, 45)))
        kernel.play_kernel(
            kernel.Recording(database.poses, database.velocities),
            kernel.Steps(path, jumps, moves),
            kernel.BlendTimes(
                float(database.fps), float(config.blend_s), float(config.blend_rate_s)
            ),
            kernel.Blend(self.placement, self._offset, self._rate, self._age),
            rows,
        )
        self.frame = int(path[-1])
        contacts = database.contacts[entered]
        return Played(entered, rows.poses, contacts, jumps, rows.placements, rows.velocities)


@dataclass(frozen=True, eq=False)
class FrameSteps:
    """Steps between consecutive frames of a graph, as pairs of poses and velocities.

    Attributes:
        starts: (k, 59) pose at the start of each step.
        ends: (k, 59) pose at its end.
        start_velocities: (k, 45) velocity at the start.
        end_velocities: (k, 45) velocity at the end.
    """

    starts: FloatArray
    ends: FloatArray
    start_velocities: FloatArray
    end_velocities: FloatArray


def recorded_steps(
    graph: MotionGraph, before: int, played: Played, some: slice = slice(None)
) -> FrameSteps:
    """The recorded steps of a played piece: placed, not blended.

    The step to a frame reached by a jump begins at the frame recorded before it, moved onto the
    frame that was left.

    Args:
        graph: The graph.
        before: The frame played before the first of them.
        played: The piece.
        some: Which of its frames; by default all.
    """
    database, entered, places = graph.database, played.frames[some], played.placements[some]
    left = np.concatenate([[before], entered[:-1]])
    left = np.where(played.jumps[some], entered - 1, left)
    return FrameSteps(
        place_poses(database.poses[left], places),
        place_poses(database.poses[entered], places),
        place_velocities(database.velocities[left], places),
        place_velocities(database.velocities[entered], places),
    )
