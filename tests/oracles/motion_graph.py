"""The lower layer of the motion graph, slow and readable: distances, pruning, ways; pair by pair.

Nothing is shared with the product but quaternion arithmetic. Frames are really laid over each
other, every quarter turn is built, and matrices are dense.
"""

import math
from itertools import product

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.frame_database import MotionDatabase
from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import FEET

Vector = npt.NDArray[np.float64]
Matrix = npt.NDArray[np.float64]

UNWEIGHTED = ("neck", "left_ankle", "right_ankle")


def moved(pose: Vector, velocity: Vector, yaw: float, shift: Vector) -> tuple[Vector, Vector]:
    """A frame turned about the vertical, then shifted."""
    pose, velocity = pose.copy(), velocity.copy()
    turn = rotations.from_yaw(yaw)
    pose[:3] = rotations.rotate(turn, pose[:3]) + shift
    pose[3:7] = rotations.multiply(turn, pose[3:7])
    velocity[:3] = rotations.rotate(turn, velocity[:3])
    return pose, velocity


def laid_over(
    pose: Vector, velocity: Vector, other: Vector, config: GraphConfig
) -> tuple[Vector, Vector]:
    """A frame as it stands when it has been laid over another as far as coordinates allow."""
    if config.coordinates is Coordinates.FIXED:
        return pose, velocity
    apart = float(rotations.yaw_of(other[3:7])) - float(rotations.yaw_of(pose[3:7]))
    if config.coordinates is Coordinates.RELATIVE:
        pose, velocity = moved(pose, velocity, apart, np.zeros(3))
        shift = other[:3] - pose[:3]
        shift[2] = 0.0
        return moved(pose, velocity, 0.0, shift)
    quarters = [0.5 * math.pi * k for k in range(-4, 5)]
    pose, velocity = moved(pose, velocity, min(quarters, key=lambda q: abs(q - apart)), np.zeros(3))
    shift = np.zeros(3)
    for axis, size in enumerate((config.block_m, config.block_m, config.block_height_m)):
        reach = int(abs(other[axis] - pose[axis]) / size) + 2
        blocks = [k * size for k in range(-reach, reach + 1)]
        shift[axis] = min(blocks, key=lambda s: abs(other[axis] - pose[axis] - s))
    return moved(pose, velocity, 0.0, shift)


def distance(
    first: tuple[Vector, Vector],
    second: tuple[Vector, Vector],
    joints: tuple[str, ...],
    config: GraphConfig,
) -> float:
    """Equations 2 and 3 for two frames, each a pose and a velocity."""
    (pose, velocity), (other, its_velocity) = first, laid_over(*second, first[0], config)
    total = sum((pose[k] - other[k]) ** 2 for k in range(3))
    rates = sum((velocity[k] - its_velocity[k]) ** 2 for k in range(3))
    # The root turns as the joints do; it has no name among them.
    for k, name in enumerate(("pelvis", *joints)):
        if name in UNWEIGHTED:
            continue
        quaternion = slice(3 + 4 * k, 7 + 4 * k)
        angle = float(rotations.angle_between(pose[quaternion], other[quaternion]))
        total += (angle / 2.0) ** 2
        turning = slice(3 + 3 * k, 6 + 3 * k)
        rates += sum(((velocity[turning] - its_velocity[turning]) / 2.0) ** 2)
    return float(total + config.velocity_weight * rates)


def matrix(
    poses: Matrix, velocities: Matrix, joints: tuple[str, ...], config: GraphConfig
) -> Matrix:
    """(n, n) distances between all frames."""
    frames = list(zip(poses, velocities, strict=True))
    return np.array([[distance(a, b, joints, config) for b in frames] for a in frames])


def contact_rule(contacts: npt.NDArray[np.bool_], clip_of: Vector, strict: bool) -> Matrix:
    """(n, n) whether the steps from i and from j may be exchanged."""
    n = len(contacts)
    allowed = np.zeros((n, n), dtype=bool)
    for i, j in product(range(n), repeat=2):
        if i + 1 == n or j + 1 == n or clip_of[i + 1] != clip_of[i] or clip_of[j + 1] != clip_of[j]:
            continue
        same = (contacts[i] == contacts[j]).all() and (contacts[i + 1] == contacts[j + 1]).all()
        changes = (contacts[i] != contacts[i + 1]).any()
        allowed[i, j] = same and (changes or not strict)
    return allowed


def stutters(i: int, j: int, clip_of: Vector, config: GraphConfig) -> bool:
    """Whether frames lie so close in one clip that no jump is worth it."""
    return bool(clip_of[i] == clip_of[j]) and (
        i == j or abs(i - j) / config.fps < config.stutter_s - 1e-9
    )


def is_local_maximum(i: int, j: int, distances: Matrix, left: Matrix, clip_of: Vector) -> bool:
    """Whether no neighbour of a pair that is left has a larger probability."""
    own = (distances[i, j], *sorted((i, j)))
    for a, b in product((i - 1, i, i + 1), (j - 1, j, j + 1)):
        if not (0 <= a < len(left) and 0 <= b < len(left) and left[a, b]):
            continue
        if clip_of[a] != clip_of[i] or clip_of[b] != clip_of[j]:
            continue
        if (distances[a, b], *sorted((a, b))) < own:
            return False
    return True


def transitions(
    distances: Matrix, contacts: npt.NDArray[np.bool_], clip_of: Vector, config: GraphConfig
) -> tuple[list[tuple[int, int]], list[int]]:
    """Jumps (source, target) that three rules leave, and how many each left.

    Args:
        distances: (n, n) between frames.
        contacts: (n, c).
        clip_of: (n,).
        config: Rules and thresholds.
    """
    n = len(contacts)
    left = contact_rule(contacts, clip_of, config.contact_change)

    def jumps() -> list[tuple[int, int]]:
        pairs = product(range(n), repeat=2)
        return [p for p in pairs if left[p] and not stutters(*p, clip_of, config)]

    counts = [len(jumps())]
    left = left & (np.exp(-distances / config.sigma) >= config.least_probability)
    counts.append(len(jumps()))
    if config.keeps_local_maxima:
        best = [p for p in jumps() if is_local_maximum(*p, distances, left, clip_of)]
        counts.append(len(best))
    else:
        best = jumps()
    return [(i, j + 1) for i, j in best], counts


def feet_stay_planted(
    database: MotionDatabase, source: int, target: int, config: GraphConfig, character: Character
) -> bool:
    """Whether no foot that stands through a whole blend would have to slip too far for it."""
    blend = range(target, target + max(1, round(config.blend_s * config.fps)))
    (clip,) = (clip for clip in database.clips if clip.start <= target < clip.stop)
    matched, left = target - 1, database.poses[source]
    laid, _ = laid_over(database.poses[matched], database.velocities[matched], left, config)
    places = character.kinematics(np.stack([left, laid])).positions
    for column, side in enumerate(FEET):
        stands = all(k < clip.stop and database.contacts[k, column] for k in blend)
        before, after = places[:, character.body(f"{side}_foot"), :2]
        if stands and np.linalg.norm(after - before) > config.slip_m:
            return False
    return True


def reachable(start: int, ways: dict[int, set[int]]) -> set[int]:
    """Frames to which some way leads from a frame, over one step or more."""
    found: set[int] = set()
    left = [start]
    while left:
        for frame in ways[left.pop()] - found:
            found.add(frame)
            left.append(frame)
    return found


def largest_component(frames: int, ways: list[tuple[int, int]]) -> set[int]:
    """Frames of the largest strongly connected component; empty where no way leads back.

    Two frames belong together where each can be reached from the other. Of components of one size
    it is the one with the earliest frame.
    """
    following: dict[int, set[int]] = {frame: set() for frame in range(frames)}
    for source, target in ways:
        following[source].add(target)
    reached = {frame: reachable(frame, following) for frame in range(frames)}
    components = [{j for j in reached[i] if i in reached[j]} for i in range(frames)]
    return max(components, key=lambda component: (len(component), -min(component, default=0)))


def graph(
    database: MotionDatabase, jumps: list[tuple[int, int, float]], config: GraphConfig
) -> dict[int, dict[int, float]]:
    """For each frame of the component the probabilities of the ways from it (eq. 1).

    Args:
        database: The frames.
        jumps: Source, target and distance of the jumps that three rules have left.
        config: Says sigma.
    """
    distances = {(source, target): distance for source, target, distance in jumps}
    for clip in database.clips:
        distances |= {(frame, frame + 1): 0.0 for frame in range(clip.start, clip.stop - 1)}
    inside = largest_component(len(database), list(distances))
    rows: dict[int, dict[int, float]] = {frame: {} for frame in sorted(inside)}
    for (source, target), distance in distances.items():
        if source in inside and target in inside:
            rows[source][target] = math.exp(-distance / config.sigma)
    return {
        frame: {target: weight / sum(row.values()) for target, weight in row.items()}
        for frame, row in rows.items()
    }
