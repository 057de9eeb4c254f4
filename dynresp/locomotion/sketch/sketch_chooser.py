"""Choose the action that follows a sketch best: the paper's method (Lee et al. 2002, section 5.2).

An action is a cluster path of the tree at the current frame. Its motion is the most probable one
(eq. 7), which then stays in the last cluster along the most probable jumps. The centre of mass of
that motion goes along a path over the ground. The action whose path is nearest to the sketch, by
dynamic time warping, is chosen.

This suits worlds whose motion is clustered and that have room for only a few actions, such as the
step stool. For long paths and obstacles use `dynresp.locomotion.sketch.sketch_control`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.graph.placement import compose, inverse
from dynresp.locomotion.vision.time_warping import warp_onto_rows
from dynresp.locomotion.worlds.paths import as_path, check_length, resampled
from dynresp.motion.character import Character, default_character
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import IntArray
from dynresp.support.errors import UsageError

# Distance between the points of a sketch that are compared with a path [m].
_SPACING = 0.1


@dataclass(frozen=True, eq=False)
class SketchedAction:
    """An action that follows a sketch.

    Attributes:
        frames: (s,) frames to play after the one at which it was chosen.
        path: (s, 2) the centre of mass over the ground [m].
        clusters: (p,) its cluster path.
        cost: Sum of distances between matched points of the sketch and of the path [m]; the least
            of all actions.
        actions: Number of actions to choose from.
    """

    frames: IntArray
    path: FloatArray
    clusters: IntArray
    cost: float
    actions: int


class SketchChooser:
    """Chooses actions by sketch.

    Attributes:
        forest: The cluster trees, which hold the actions.
        ahead_s: Longest time of an action [s].
        ahead_m: Length of the sketch's beginning that is compared [m].
    """

    def __init__(
        self,
        forest: ClusterForest,
        character: Character | None = None,
        ahead_s: float = 4.0,
        ahead_m: float = 2.5,
    ) -> None:
        """Compute the centre of mass of each frame.

        Args:
            forest: The cluster trees, which hold the actions.
            character: Whose motions they are, by default the product's own.
            ahead_s: Longest time of an action [s].
            ahead_m: Length of the sketch's beginning that is compared [m].

        Raises:
            UsageError: A length or time is not above 0.
        """
        if not (ahead_s > 0.0 and ahead_m > 0.0):
            raise UsageError(f"ahead_s and ahead_m must be above 0, got {ahead_s} and {ahead_m}")
        self.forest = forest
        self.ahead_s, self.ahead_m = ahead_s, ahead_m
        character = character or default_character()
        centers = character.kinematics(forest.graph.database.poses).centers
        # (n, 4) as placements: the centre moves like a root that does not turn.
        self._centers = np.zeros((len(centers), 4))
        self._centers[:, :3] = np.einsum("fbc,b->fc", centers, character.masses)
        self._centers[:, :3] /= character.masses.sum()

    def choose(self, frame: int, placement: npt.ArrayLike, sketch: npt.ArrayLike) -> SketchedAction:
        """The action that follows a sketch best.

        Args:
            frame: The frame that the avatar is at.
            placement: (4,) placement of its clip.
            sketch: (k, 2) corners of a path on the ground that begins at the avatar, at most 1 km
                long [m].

        Raises:
            UsageError: The frame is not in the graph's component, the sketch is not a path or is
                too long, or no action ends within `ahead_s`.
        """
        forest, graph = self.forest, self.forest.graph
        corners = as_path(sketch, "a sketch")
        check_length(corners, "the sketch")
        points = resampled(corners, _SPACING)[: round(self.ahead_m / _SPACING) + 1]
        lead = forest.frames_to_branch(frame)
        left = forest.steps_within(self.ahead_s) - (len(lead) - 1)
        if left < 1:
            raise UsageError(
                f"from frame {frame} on there is no choice within ahead_s = {self.ahead_s:g} s; "
                "look farther ahead"
            )
        left_s = left / graph.database.fps
        tree = forest.tree(frame, left_s)
        motions, paths = [], []
        for leaf in tree.leaves:
            motion = forest.likeliest_motion(tree, int(leaf), left_s)
            frames = np.concatenate([lead[:-1], forest.stay(motion.frames, left)])
            motions.append(frames[1:])
            paths.append(self._path(frames, placement)[1:])
        kept = [k for k, frames in enumerate(motions) if len(frames)]
        if not kept:
            raise UsageError(
                f"from frame {frame} on there is no action within ahead_s = {self.ahead_s:g} s; "
                "look farther ahead"
            )
        offsets = np.cumsum([0, *(len(paths[k]) for k in kept)], dtype=np.int64)
        warping = warp_onto_rows(points, np.concatenate([paths[k] for k in kept]), offsets, True)
        best = int(np.argmin(warping.costs))
        chosen, stop = kept[best], int(warping.stops[best])
        return SketchedAction(
            frames=motions[chosen][:stop],
            path=paths[chosen][:stop],
            clusters=tree.cluster_path(int(tree.leaves[chosen])),
            cost=float(warping.costs[best]),
            actions=len(kept),
        )

    def _path(self, frames: IntArray, placement: npt.ArrayLike) -> FloatArray:
        """(s, 2) the centre of mass over the ground while frames play [m]."""
        database = self.forest.graph.database
        roots = self.forest.root_states_along(frames, placement)
        clips = compose(roots, inverse(database.planar[frames]))
        return compose(clips, self._centers[frames])[:, :2]
