"""The search along a path and its collision test, slow and readable.

What `dynresp.locomotion.sketch.path_search` and `dynresp.locomotion.worlds` must equal on small
graphs.
"""

import copy
import heapq
import math

import mujoco
import numpy as np

from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.playing.avatar_state import AvatarState
from dynresp.locomotion.playing.blending import Playback
from dynresp.locomotion.sketch import path_search
from dynresp.locomotion.worlds.obstacles import World
from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.rotations import FloatArray


def corners(x: float, y: float, yaw: float, reach: FloatArray, margin: float) -> FloatArray:
    """(4, 2) of a footprint, counter-clockwise."""
    low_x, high_x, low_y, high_y = reach + margin * np.array([-1, 1, -1, 1])
    own = [(low_x, low_y), (high_x, low_y), (high_x, high_y), (low_x, high_y)]
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([(x + c * a - s * b, y + s * a + c * b) for a, b in own])


def overlap(first: FloatArray, second: FloatArray) -> float:
    """Area common to two convex polygons: the first is cut along the sides of the second."""
    polygon = [tuple(p) for p in first]
    for a, b in zip(second, np.roll(second, -1, axis=0), strict=True):

        def side(p: tuple[float, ...], a: FloatArray = a, b: FloatArray = b) -> float:
            return float((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]))

        kept: list[tuple[float, ...]] = []
        for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True):
            if side(p) >= 0:
                kept.append(p)
            if side(p) * side(q) < 0:
                share = side(p) / (side(p) - side(q))
                kept.append(tuple(u + share * (v - u) for u, v in zip(p, q, strict=True)))
        polygon = kept
    area = 0.0
    for p, q in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        area += 0.5 * (p[0] * q[1] - p[1] * q[0])
    return area


def collides(
    world: World, x: float, y: float, yaw: float, reach: FloatArray, margin: float
) -> bool:
    """Whether a footprint overlaps a box or leaves the world."""
    feet = corners(x, y, yaw, reach, margin)
    low_x, low_y, high_x, high_y = world.bounds
    if feet[:, 0].min() < low_x or feet[:, 0].max() > high_x:
        return True
    if feet[:, 1].min() < low_y or feet[:, 1].max() > high_y:
        return True
    for box in world.obstacles:
        half = np.array([-1, 1, -1, 1]) * np.repeat(box.half_sizes, 2)
        if overlap(feet, corners(*box.center, box.yaw, half, 0.0)) > 0:
            return True
    return False


def footprint(character: Character, pose: FloatArray) -> FloatArray:
    """(4,) how far the geoms reach around the root, where MuJoCo puts them."""
    model = character.model
    data = mujoco.MjData(model)
    data.qpos[:] = pose
    mujoco.mj_kinematics(model, data)
    back = rotations.from_yaw(-rotations.yaw_of(pose[3:7]))
    reach = np.array([np.inf, -np.inf, np.inf, -np.inf])
    for geom in range(model.ngeom):
        size, axes = model.geom_size[geom], data.geom_xmat[geom].reshape(3, 3)
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE:
            points = [size[1] * axes[:, 2], -size[1] * axes[:, 2]]
            radius = size[0]
        else:
            signs = [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
            points = [axes @ (size * np.array(s)) for s in signs]
            radius = 0.0
        for point in points:
            x, y, _ = rotations.rotate(back, data.geom_xpos[geom] + point - pose[:3])
            reach[[0, 2]] = np.minimum(reach[[0, 2]], [x - radius, y - radius])
            reach[[1, 3]] = np.maximum(reach[[1, 3]], [x + radius, y + radius])
    return reach


class Search:
    """The search of `SearchGraph.search`, state by state."""

    def __init__(
        self,
        graph: MotionGraph,
        character: Character,
        path: FloatArray,
        facing: FloatArray,
        spacing: float,
        target: float,
        world: World | None,
        crowded: int,
    ) -> None:
        self.graph, self.character, self.world = graph, character, world
        self.path, self.facing, self.spacing = path, facing, spacing
        self.target, self.crowded = target, crowded

    def nearest(self, point: FloatArray, progress: float) -> tuple[float, float]:
        """The nearest place of the path from a progress on, not far ahead, and its distance."""
        last = len(self.path) - 1
        first = min(int(progress), last - 1)
        window = math.ceil(max(0.4, 6.0 / self.graph.database.fps) / self.spacing)
        nearest, at = math.inf, progress
        for k in range(first, min(first + window, last)):
            along = self.path[k + 1] - self.path[k]
            share = float(np.clip((point - self.path[k]) @ along / (along @ along), 0, 1))
            share = max(share, min(progress - k, 1.0))
            away = float(np.linalg.norm(point - self.path[k] - share * along))
            # Of places that are alike the first one counts.
            if away**2 < nearest**2 - 1e-9:
                nearest, at = away, k + share
        return at, nearest

    def objective(self, root: FloatArray, progress: float, away: float) -> float:
        """Eq. 8 with the way left as the distance."""
        last = len(self.path) - 1
        goal = min(progress + path_search.AHEAD_M / self.spacing, last)
        k = min(int(goal), last - 1)
        to = self.path[k] + (goal - k) * (self.path[k + 1] - self.path[k]) - root[:2]
        left = max(self.target - progress, 0.0) * self.spacing + away
        straight = float(np.linalg.norm(to))
        if straight < 1e-9:
            return left
        facing = np.array([math.cos(root[3]), math.sin(root[3])])
        return left * (1.0 - self.facing[k] * float(to @ facing) / straight)

    def frames(self, frame: int, target: int) -> list[int]:
        """What is played on a way: its target and all that only goes on from it."""
        graph, out = self.graph, [target]
        while True:
            row = graph.targets[graph.offsets[out[-1]] : graph.offsets[out[-1] + 1]]
            if len(row) != 1 or row[0] != graph.database.successors[out[-1]]:
                return out
            out.append(int(row[0]))

    def run(self, start: AvatarState, progress: float, budget: int) -> tuple[list[int], bool, int]:
        """The frames of the best way, whether it arrives, and how many ways were looked at."""
        graph = self.graph
        database = graph.database
        playback = Playback(graph, start.frame, start.placement)
        # Frame, placement, progress, cost, playback, frames so far.
        states = [(start.frame, start.placement, progress, 0.0, playback, [])]
        least, best, looked = math.inf, 0, 0
        heap: list[tuple[float, int, int]] = []
        seen: set[tuple[int, ...]] = set()
        crowd: dict[tuple[int, ...], int] = {}

        def play(node: int, way: int):  # type: ignore[no-untyped-def]
            frame, place, done, cost, _, _ = states[node]
            place = placement.compose(place, graph.placements[way])
            played = self.frames(frame, int(graph.targets[way]))
            for k, f in enumerate(played):
                root = placement.compose(place, database.planar[f])
                done, away = self.nearest(root[:2], done)
                if away > path_search.MAX_OFF_PATH_M:
                    return None
                cost += path_search.PACE / database.fps * (1.0 + path_search.STRAY * away**2)
                arrived = done >= self.target - 1e-9
                if arrived or k == len(played) - 1:
                    value = self.objective(root, done, away)
                    return place, played[: k + 1], done, cost, value, arrived
            raise AssertionError

        def keys(node: int, way: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
            frame, place, done, _, _, _ = states[node]
            place = placement.compose(place, graph.placements[way])
            last = self.frames(frame, int(graph.targets[way]))[-1]
            x, y, _, yaw = placement.compose(place, database.planar[last])
            turn, visit = yaw % (2 * math.pi), int(done * self.spacing) & 7
            fine = (last, math.floor(x / 0.1), math.floor(y / 0.1), int(turn / (math.pi / 12)))
            rough = (math.floor(x / 0.25), math.floor(y / 0.25), int(turn / (math.pi / 6)))
            return (*fine, visit), (*rough, visit)

        def is_old(node: int, way: int) -> bool:
            fine, rough = keys(node, way)
            return fine in seen or crowd.get(rough, 0) >= self.crowded

        def is_far(node: int) -> bool:
            return (self.target - states[node][2]) * self.spacing > 1.5

        node = 0
        while True:
            row = range(graph.offsets[states[node][0]], graph.offsets[states[node][0] + 1])
            for way in row:
                # Ways that begin far from the target and lead to no new place are left out.
                if is_far(node) and is_old(node, way):
                    continue
                found = play(node, way)
                if found is not None:
                    cost, value = found[3], found[4]
                    cost += path_search.JUMP * float(graph.distances[way])
                    heapq.heappush(heap, (cost + value, node, way))
            node, arrived = -1, False
            while heap and looked < budget:
                _, parent, way = heapq.heappop(heap)
                fine, rough = keys(parent, way)
                place, played, done, cost, value, arrived = play(parent, way)
                looked += 1
                if is_old(parent, way) and (is_far(parent) or not arrived):
                    continue
                _, _, _, _, before, so_far = states[parent]
                playback = copy.deepcopy(before, {id(graph): graph})
                if self.world is not None and not self.free(place, played, playback):
                    continue
                seen.add(fine)
                crowd[rough] = crowd.get(rough, 0) + 1
                node = len(states)
                cost += path_search.JUMP * float(graph.distances[way])
                states.append((played[-1], place, done, cost, playback, so_far + played))
                if value < least:
                    least, best = value, node
                break
            if node < 0 or arrived:
                return states[node if node >= 0 else best][5], arrived, looked

    def free(self, place: FloatArray, played: list[int], playback: Playback) -> bool:
        """Whether frames touch nothing, neither as recorded nor as played."""
        assert self.world is not None
        for frame in played:
            pose = self.graph.database.poses[frame]
            x, y, _, yaw = placement.compose(place, self.graph.database.planar[frame])
            if collides(self.world, x, y, yaw, footprint(self.character, pose), 0.0):
                return False
        for pose in playback.play(played).poses:
            yaw = float(rotations.yaw_of(pose[3:7]))
            reach = footprint(self.character, pose)
            if collides(self.world, pose[0], pose[1], yaw, reach, path_search.MARGIN_M):
                return False
        return True
