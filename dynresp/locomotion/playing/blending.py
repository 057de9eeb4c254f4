"""Frames of a graph played as one continuous motion: displacement mapping (section 4.1.1).

After a jump from frame i to frame j the recorded motion is displaced so that pose and velocity at
frame j - 1 are those played at frame i; the displacement decays to nothing over the blend, and what
the difference in velocity adds to it over a shorter time. The pose played at i holds what is left
of earlier displacements, so blends may overlap.
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
    """A stretch of played motion.

    Attributes:
        frames: (k,) the frames of the database.
        poses: (k, 59) as played, in the world.
        contacts: (k, 2 or 4) of the frames.
        jumps: (k,) whether a frame was reached by a jump.
        placements: (k, 4) where the clip of each frame was put: its recorded pose, placed there, is
            what was displaced.
        velocities: (k, 45) how the poses move.
    """

    frames: IntArray
    poses: FloatArray
    contacts: BoolArray
    jumps: BoolArray
    placements: FloatArray
    velocities: FloatArray


class Playback:
    """Plays frames of a graph one after the other; the next stretch goes on where the last ended.

    Attributes:
        graph: Whose frames.
        frame: The frame played last.
        placement: (4,) where its clip is put.
    """

    def __init__(self, graph: MotionGraph, frame: int, place: npt.ArrayLike = IDENTITY) -> None:
        """Begin after a frame that was played as it was recorded.

        Args:
            graph: Whose frames.
            frame: A frame of the graph's database.
            place: (4,) where its clip is put.
        """
        self.graph = graph
        self.frame = frame
        self.placement = np.array(place, dtype=np.float64)
        self._offset, self._rate = np.zeros(45), np.zeros(45)
        self._age = np.array([graph.config.blend_s])

    @classmethod
    def entering(
        cls, graph: MotionGraph, frame: int, pose: FloatArray, velocity: FloatArray
    ) -> Playback:
        """Begin after any pose: the motion recorded after a frame is blended on to it.

        Args:
            graph: Whose frames.
            frame: The frame that resembles the pose; the next one recorded is to be played.
            pose: (59,) as played last, in the world.
            velocity: (45,) how it moves.
        """
        from dynresp.locomotion.playing.blending_kernel import displacement_kernel

        database = graph.database
        planar = of_poses(pose[None])
        place = placements_between(planar, database.planar[frame : frame + 1], graph.config)[0]
        playback = cls(graph, frame, place)
        displacement_kernel(
            np.ascontiguousarray(pose), np.ascontiguousarray(velocity), playback.placement,
            database.poses[frame], database.velocities[frame], playback._offset, playback._rate,
        )  # fmt: skip
        playback._age[0] = 0.0
        return playback

    @property
    def displacement(self) -> FloatArray:
        """(91,) what is left of blends after the frame played last.

        The displacement at the last jump (45) [m, rad], its rate of change then (45) [1/s], and the
        time since [s]; see `blending_kernel.displacement_kernel`.
        """
        return np.concatenate([self._offset, self._rate, self._age])

    def play(self, frames: npt.ArrayLike) -> Played:
        """Play the next frames.

        Args:
            frames: (k,) the first follows the frame played last: the one recorded after it, or one
                jumped to.

        Raises:
            MotionError: A jump leads to the first frame of a clip, before which none is recorded.
        """
        from dynresp.locomotion.playing.blending_kernel import play_kernel

        database, config = self.graph.database, self.graph.config
        path = np.concatenate([[self.frame], np.asarray(frames)]).astype(np.int32)
        left, entered = path[:-1], path[1:]
        jumps = database.successors[left] != entered
        first = (entered == 0) | (database.clip_of[entered] != database.clip_of[entered - 1])
        if (jumps & first).any():
            frame = int(entered[np.argmax(jumps & first)])
            raise MotionError(f"no jump can lead to frame {frame}, the first of its clip")
        moves = self.graph.placements_between(left, entered)
        count = len(entered)
        poses, placements = np.empty((count, 59)), np.empty((count, 4))
        moving = np.empty((count, 45))
        play_kernel(
            database.poses, database.velocities, path, jumps, moves, database.fps, config.blend_s,
            config.blend_rate_s,
            self.placement, self._offset, self._rate, self._age, poses, placements,
            moving,
        )  # fmt: skip
        self.frame = int(path[-1])
        return Played(entered, poses, database.contacts[entered], jumps, placements, moving)


@dataclass(frozen=True, eq=False)
class KnotSteps:
    """Steps from one pose to another that are as far apart in time as a graph's frames.

    Attributes:
        starts: (k, 59) where each step begins.
        ends: (k, 59) where it ends.
        moving_starts: (k, 45) how it moves at its beginning.
        moving_ends: (k, 45) and at its end.
    """

    starts: FloatArray
    ends: FloatArray
    moving_starts: FloatArray
    moving_ends: FloatArray


def recorded_steps(
    graph: MotionGraph, before: int, played: Played, some: slice = slice(None)
) -> KnotSteps:
    """What was recorded of what was played: placed, nothing blended.

    A frame that was jumped to comes from the one recorded before it, which is laid over the frame
    left.

    Args:
        graph: Whose frames.
        before: The frame played before the first of them.
        played: What was played.
        some: Which of its frames; by default all.
    """
    database, entered, places = graph.database, played.frames[some], played.placements[some]
    left = np.concatenate([[before], entered[:-1]])
    left = np.where(played.jumps[some], entered - 1, left)
    return KnotSteps(
        place_poses(database.poses[left], places),
        place_poses(database.poses[entered], places),
        place_velocities(database.velocities[left], places),
        place_velocities(database.velocities[entered], places),
    )
