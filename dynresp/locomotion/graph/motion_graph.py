"""A motion graph: frames, and transitions between them (Lee et al. 2002, section 4.1).

The graph is the paper's lower layer, a Markov process whose states are frames. After frame i comes
the frame recorded after it, or a jump to a frame j whose predecessor j - 1 resembles i. Jumps are
pruned by the paper's four rules. The last rule keeps one strongly connected component, so a walk
through the graph never ends.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.motion import rotations
from dynresp.motion.character import Character, default_character
from dynresp.motion.feet import legs
from dynresp.motion.feet.contact_cases import ContactCase, contact_cases
from dynresp.motion.motion import FEET, Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.arrays import BoolArray, IntArray, frozen
from dynresp.support.errors import MotionError


@dataclass(frozen=True)
class PruningCounts:
    """Numbers of jumps that each pruning rule leaves, as in the paper's table 1.

    Attributes:
        frames: Frames of the database.
        pairs: Pairs of frames considered.
        contact: Jumps left by the first rule, similar contacts.
        likelihood: By the second rule, a probability above the threshold.
        similarity: By the third rule, local maxima; None if the rule is not used.
        footing: By the rule of `feet_stay_planted`.
        component: By the fourth rule, inside the largest strongly connected component.
        component_frames: Frames of that component.
    """

    frames: int
    pairs: int
    contact: int
    likelihood: int
    similarity: int | None
    footing: int
    component: int
    component_frames: int


@dataclass(frozen=True, eq=False)
class MotionGraph:
    """Frames, and the transitions from each frame to the next ones. Arrays are read-only.

    A transition is the recorded step to frame i + 1 or a jump. Jumps are sorted by their
    source: those of frame i are `offsets[i]` to `offsets[i + 1]`. A frame outside the component
    has none. The first transition of a frame is the recorded one, unless frame i + 1 is outside
    the component.

    Attributes:
        database: The frames.
        config: Settings by which it was built.
        counts: Numbers of jumps that each pruning rule left.
        offsets: (n + 1,) where the transitions of each frame begin.
        targets: (m,) the frame to which each transition leads.
        distances: (m,) distance between the source and the frame before the target (eq. 2); 0
            for a recorded transition.
    """

    database: MotionDatabase
    config: GraphConfig
    counts: PruningCounts
    offsets: npt.NDArray[np.int64]
    targets: IntArray
    distances: npt.NDArray[np.float32]

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for array in (self.offsets, self.targets, self.distances):
            array.flags.writeable = False

    @classmethod
    def build(
        cls,
        motions: Sequence[Motion],
        config: GraphConfig | None = None,
        character: Character | None = None,
        contacts: Sequence[BoolArray] | None = None,
        credit_lines: tuple[str, ...] = (),
        threads: int = 0,
    ) -> MotionGraph:
        """Build a graph from motions.

        Args:
            motions: At any frame rate.
            config: Settings.
            character: The character of the motions, by default the product's own.
            contacts: See `MotionDatabase.from_motions`.
            credit_lines: `MotionDatabase.credits`.
            threads: Threads, 0 for all cores; the graph is the same bit for bit.

        Raises:
            MotionError: There is no motion long enough, or no transition is left.
        """
        config = config or GraphConfig()
        character = character or default_character()
        database = MotionDatabase.from_motions(
            motions, character, config.fps, config.mirrored, contacts, credit_lines
        )
        return cls.from_database(database, config, character, threads)

    @classmethod
    def from_database(
        cls,
        database: MotionDatabase,
        config: GraphConfig | None = None,
        character: Character | None = None,
        threads: int = 0,
    ) -> MotionGraph:
        """Build a graph from a database that has the configuration's frame rate.

        Args:
            database: The frames.
            config: Settings.
            character: The character of the motions, by default the product's own.
            threads: Threads, 0 for all cores; the graph is the same bit for bit.

        Raises:
            MotionError: The frame rates differ, or no transition is left.
        """
        from dynresp.locomotion.graph.pruning import find_jumps

        config = config or GraphConfig()
        if database.fps != config.fps:
            raise MotionError(
                f"the database has {database.fps:g} fps and the configuration {config.fps:g}; "
                "gather the motions at that rate"
            )
        found = find_jumps(database, config, threads)
        sources, targets, distances = found.sources, found.targets, found.distances
        kept = feet_stay_planted(
            database, config, character or default_character(), sources, targets
        )
        sources, targets, distances = sources[kept], targets[kept], distances[kept]
        footing = len(sources)
        inside = _largest_component(database.successors, sources, targets)
        kept = inside[sources] & inside[targets]
        sources, targets, distances = sources[kept], targets[kept], distances[kept]
        if not inside.any():
            raise MotionError(
                "no endless walk is possible: no frame resembles another enough. "
                "Give more motion, a larger sigma, or a smaller least_probability"
            )
        counts = PruningCounts(
            frames=len(database),
            pairs=len(database) ** 2,
            contact=found.contact,
            likelihood=found.likelihood,
            similarity=found.similarity,
            footing=footing,
            component=len(sources),
            component_frames=int(np.count_nonzero(inside)),
        )
        offsets, targets, distances = _sorted_transitions(
            database.successors, inside, sources, targets, distances
        )
        return cls(database, config, counts, offsets, targets, distances)

    @functools.cached_property
    def sources(self) -> IntArray:
        """(m,) the frame from which each transition leads."""
        frames = np.arange(len(self.database), dtype=np.int32)
        return frozen(np.repeat(frames, np.diff(self.offsets)))

    @functools.cached_property
    def probabilities(self) -> FloatArray:
        """(m,) probability of each transition (eq. 1); those of one frame add up to 1."""
        weights = np.exp(-self.distances.astype(np.float64) / self.config.sigma)
        lengths = np.diff(self.offsets)
        filled = np.flatnonzero(lengths)
        sums = np.add.reduceat(weights, self.offsets[filled])
        return frozen(weights / np.repeat(sums, lengths[filled]))

    @functools.cached_property
    def cumulative(self) -> FloatArray:
        """(m,) cumulative probabilities of each frame's transitions; the last is exactly 1."""
        sums = np.cumsum(self.probabilities)
        before = np.concatenate([[0.0], sums])[self.offsets[self.sources]]
        along = np.minimum(sums - before, 1.0)
        along[self.offsets[1:][np.diff(self.offsets) > 0] - 1] = 1.0
        return frozen(along)

    @functools.cached_property
    def frames(self) -> IntArray:
        """(k,) frames of the component, ascending."""
        return frozen(np.flatnonzero(np.diff(self.offsets)).astype(np.int32))

    @functools.cached_property
    def placements(self) -> FloatArray:
        """(m, 4) placement of the target's clip relative to the source's clip, per transition."""
        return frozen(self.placements_between(self.sources, self.targets))

    def placements_between(self, sources: npt.ArrayLike, targets: npt.ArrayLike) -> FloatArray:
        """Placements of the targets' clips relative to the sources' clips.

        Args:
            sources: (k,) frames that are left.
            targets: (k,) frames that are entered.

        Returns:
            (k, 4) placements; see `dynresp.locomotion.graph.placement`. Zero for recorded
            transitions.
        """
        left, entered = np.asarray(sources), np.asarray(targets)
        out = np.zeros((len(left), 4))
        jumps = self.database.successors[left] != entered
        if self.config.coordinates is Coordinates.FIXED or not jumps.any():
            return out
        planar = self.database.planar
        out[jumps] = placements_between(
            planar[left[jumps]], planar[entered[jumps] - 1], self.config
        )
        return out


def placements_between(left: FloatArray, matched: FloatArray, config: GraphConfig) -> FloatArray:
    """Placements that move frames onto others, as far as the coordinates allow.

    Args:
        left: (k, 4) planar states of the frames that are left.
        matched: (k, 4) planar states of the frames that are moved onto them.
        config: Gives the coordinates.

    Returns:
        (k, 4).
    """
    if config.coordinates is Coordinates.FIXED:
        return np.zeros((len(left), 4))
    if config.coordinates is Coordinates.RELATIVE:
        out = placement.compose(left, placement.inverse(matched))
        out[:, 2] = 0.0
        return out
    turns = np.zeros((len(left), 4))
    turns[:, 3] = 0.5 * np.pi * np.round((left[:, 3] - matched[:, 3]) / (0.5 * np.pi))
    shift = left - placement.compose(turns, matched)
    cell = np.array([config.block_m, config.block_m, config.block_height_m])
    turns[:, :3] = np.round(shift[:, :3] / cell) * cell
    turns[:, 3] = placement.wrapped(turns[:, 3])
    return turns


def feet_stay_planted(
    database: MotionDatabase,
    config: GraphConfig,
    character: Character,
    sources: IntArray,
    targets: IntArray,
) -> BoolArray:
    """Which jumps make no foot slip through the whole blend: the paper's case 4 (section 4.1.1).

    A foot that is lifted during the blend is put down where it belongs. A foot that stands from the
    jump to the end of the blend cannot be: it slips, or stays in the wrong position.

    Args:
        database: The frames.
        config: Length of the blend, how far a foot may slip, and the coordinates.
        character: The character of the database.
        sources: (m,) frames that are left.
        targets: (m,) frames that are entered.

    Returns:
        (m,).
    """
    ends = np.array([clip.stop for clip in database.clips])[database.clip_of]
    blend = max(1, round(config.blend_s * config.fps))
    cases = contact_cases(database.contacts[:, :2], ends, sources, targets, blend)
    kept = np.ones(len(sources), dtype=bool)
    across = np.flatnonzero((cases == ContactCase.ACROSS).any(axis=1))
    if len(across) == 0:
        return kept
    left, matched = sources[across], targets[across] - 1
    moves = placements_between(database.planar[left], database.planar[matched], config)
    ankles = legs.ankle_positions(character, character.kinematics(database.poses))
    turns = rotations.from_yaw(moves[:, 3])
    for foot in range(len(FEET)):
        there = rotations.rotate(turns, ankles[matched, foot]) + moves[:, :3]
        apart = np.linalg.norm((there - ankles[left, foot])[:, :2], axis=1)
        stands = cases[across, foot] == ContactCase.ACROSS
        kept[across] &= ~(stands & (apart > config.slip_m))
    return kept


def _largest_component(successors: IntArray, sources: IntArray, targets: IntArray) -> BoolArray:
    """(n,) whether a frame is in the largest strongly connected component of more than one."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    n = len(successors)
    own = np.flatnonzero(successors >= 0)
    rows = np.concatenate([own, sources])
    columns = np.concatenate([successors[own], targets])
    steps = csr_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(n, n))
    _, labels = connected_components(steps, directed=True, connection="strong")
    sizes = np.bincount(labels)
    # Among components of equal size the one whose frames come first.
    largest = int(labels[np.argmax(sizes[labels] == sizes.max())])
    return (labels == largest) & (sizes.max() > 1)


def _sorted_transitions(
    successors: IntArray,
    inside: BoolArray,
    sources: IntArray,
    targets: IntArray,
    distances: npt.NDArray[np.float32],
) -> tuple[npt.NDArray[np.int64], IntArray, npt.NDArray[np.float32]]:
    """Offsets, targets and distances of the transitions; a frame's recorded one comes first."""
    own = np.flatnonzero(inside & (successors >= 0) & inside[successors])
    all_sources = np.concatenate([own, sources])
    all_targets = np.concatenate([successors[own], targets])
    is_jump = np.arange(len(all_sources)) >= len(own)
    order = np.lexsort((all_targets, is_jump, all_sources))
    offsets = np.zeros(len(successors) + 1, dtype=np.int64)
    np.cumsum(np.bincount(all_sources, minlength=len(successors)), out=offsets[1:])
    all_distances = np.concatenate([np.zeros(len(own), dtype=np.float32), distances])
    return offsets, all_targets[order].astype(np.int32), all_distances[order]
