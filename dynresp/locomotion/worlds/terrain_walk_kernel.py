"""The compiled search for walks over blocks on which every foot stands.

Importing this module imports numba; import it where it is used.

A clip is placed in whole blocks, whole levels and quarter turns. So a cell placement is four whole
numbers: column, row, level, quarter turns. A foot that stands has a block and a recorded level. Its
lift is the level of the block below it, less its recorded level and that of the placement. On the
recorded blocks all lifts are equal. A state of the search is a frame, the cell placement of its
clip and the lift of the last stance of each foot.
"""

from __future__ import annotations

import heapq
import math
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.typed import Dict

from dynresp.locomotion.worlds.path_kernel import eq_8, nearest_on
from dynresp.support.array_growth_kernel import doubled
from dynresp.support.compiling import compiled, helper

# Eq. 8: c, and how far ahead on the path the point is that the avatar should face [m].
_FACING, _AHEAD_M = 0.2, 0.6
# Cost of a second [m]. At a distance d from a path a second costs 1 + _STRAY d^2 times as much
# [1/m^2]; states farther from it than _MAX_OFF_PATH_M [m] are dropped.
_PACE, _STRAY, _MAX_OFF_PATH_M = 0.1, 2.0, 2.0
# Cost of a jump for each unit of its distance (eq. 2) [m]. A jump right after another costs _HURRY
# more [m]; that falls to 0 over _HURRY_S [s].
_JUMP, _HURRY, _HURRY_S = 1.0, 0.3, 1.0
# Cost of a stance on another level than recorded, for each squared level [m], and of each metre by
# which a foot is drawn in from an edge [m].
_LEVEL_CHANGE, _DRAW = 0.2, 2.0

COLUMN, ROW, LEVEL, TURNS, LEFT, RIGHT, STATE = range(7)
"""Entries of a state: cell placement of its clip, then the lifts of both feet; and their number."""

# Ranges in a key: columns and rows from -_BESIDE to _WRAP - _BESIDE.
_WRAP, _BESIDE = 1 << 20, 1 << 10


class WalkSettings(NamedTuple):
    """Limits and units of a search.

    Attributes:
        max_level_change: Most levels by which a stance may be higher or lower than recorded, seen
            from the last stance of the other foot.
        max_draw_m: Largest distance by which a foot is drawn in from an edge [m].
        arrival_m: Largest distance of the root from the end of the path at arrival [m].
        spacing_m: Distance of the points of the path [m].
        block_m: Side of a block [m].
        frame_s: Time of a frame [s].
        greed: Weight of eq. 8 against the costs.
        window: Points of the path that `nearest_on` looks at.
        budget: Most states to continue.
    """

    max_level_change: float
    max_draw_m: float
    arrival_m: float
    spacing_m: float
    block_m: float
    frame_s: float
    greed: float
    window: int
    budget: int


class GraphArrays(NamedTuple):
    """A motion graph as the search needs it; see `MotionGraph` and `TerrainGraph`. Read-only.

    Attributes:
        offsets: (n + 1,) int64, where the row of edges of each frame begins.
        targets: (m,) int32.
        distances: (m,) float32.
        moves: (m, 4) int64, cell placement of the target's clip seen from the source's.
        planar: (n, 3) x, y [m] and yaw [rad] of the roots.
    """

    offsets: Any
    targets: Any
    distances: Any
    moves: Any
    planar: Any


class FeetArrays(NamedTuple):
    """How the feet of each frame stand; see `TerrainGraph`. Read-only.

    Attributes:
        stands: (n, 2) bool.
        blocks: (n, 2, 2) int64.
        levels: (n, 2) int64.
        over: (n, 2, 4) how far the sole reaches over each edge, with the distance to keep [m].
    """

    stands: Any
    blocks: Any
    levels: Any
    over: Any


class FoundWalk(NamedTuple):
    """What a search found.

    Attributes:
        frames: (k,) int32, the frames after the start.
        placements: (k, 4) int64, their cell placements.
        arrived: Whether it arrived; if not, the frames lead to the state with the least value of
            eq. 8.
        looked: Number of states that were continued.
    """

    frames: Any
    placements: Any
    arrived: Any
    looked: Any


_REAL, _INT = types.float64, types.int64
_WHOLES = types.Array(_INT, 1, "C", readonly=True)
_ROWS = types.Array(_REAL, 2, "C", readonly=True)
_TABLE = types.Array(_INT, 2, "C", readonly=True)
_SETTINGS = types.NamedTuple((*[_REAL] * 7, _INT, _INT), WalkSettings)
_GRAPH = types.NamedTuple(
    (
        _WHOLES,
        types.Array(types.int32, 1, "C", readonly=True),
        types.Array(types.float32, 1, "C", readonly=True),
        _TABLE,
        _ROWS,
    ),
    GraphArrays,
)
_FEET = types.NamedTuple(
    (
        types.Array(types.boolean, 2, "C", readonly=True),
        types.Array(_INT, 3, "C", readonly=True),
        _TABLE,
        types.Array(_REAL, 3, "C", readonly=True),
    ),
    FeetArrays,
)
_FOUND = types.NamedTuple((types.int32[::1], _INT[:, ::1], types.boolean, _INT), FoundWalk)


@helper
def _turned(a, b, turns):
    """The block (a, b) after quarter turns about the origin, a corner of blocks."""
    if turns == 0:
        return a, b
    if turns == 1:
        return -b - 1, a
    if turns == 2:
        return -a - 1, -b - 1
    return b, -a - 1


@helper
def _moved(state, move, out):
    """Write the state after an edge: its cell placement, composed with the edge's; same lifts."""
    a, b = move[0], move[1]
    for _ in range(state[TURNS]):
        a, b = -b, a
    out[COLUMN], out[ROW] = state[COLUMN] + a, state[ROW] + b
    out[LEVEL] = state[LEVEL] + move[2]
    out[TURNS] = (state[TURNS] + move[3]) % 4
    out[LEFT], out[RIGHT] = state[LEFT], state[RIGHT]


@helper
def _block(blocks, frame, foot, state):
    """Column and row of the block on which a foot stands."""
    a, b = _turned(blocks[frame, foot, 0], blocks[frame, foot, 1], state[TURNS])
    return a + state[COLUMN], b + state[ROW]


@helper
def _level_at(grid, a, b, otherwise):
    """Level of a block, or another number beside the grid."""
    if 0 <= a < grid.shape[0] and 0 <= b < grid.shape[1]:
        return grid[a, b]
    return otherwise


@helper
def _drawn(grid, a, b, over, turns):
    """How far a foot must be drawn in from edges of its block at which the height changes [m]."""
    here = grid[a, b]
    x = y = 0.0
    for side in range(4):
        if over[side] <= 0.0:
            continue
        # Directions 0 to 3 are +x, +y, -x, -y.
        to = (side + turns) % 4
        step_x = (1, 0, -1, 0)[to]
        step_y = (0, 1, 0, -1)[to]
        if _level_at(grid, a + step_x, b + step_y, here - 100) != here:
            if step_x != 0:
                x = max(x, over[side])
            else:
                y = max(y, over[side])
    return math.hypot(x, y)


@helper
def _stand(grid, feet, entry, source, before, state, settings):
    """Check and cost the stances that begin as the walk goes from a frame to the next.

    Args:
        grid: (columns, rows) levels of the blocks.
        feet: How feet stand.
        entry: The next frame.
        source: The frame before it.
        before: (6,) state of that frame.
        state: (6,) in and out, the next state with the lifts of the one before; the lifts of
            stances that begin are set.
        settings: Limits.

    Returns:
        Cost of the stances that begin [m], infinite where a foot cannot stand.
    """
    stands, levels = feet.stands, feet.levels
    cost = 0.0
    for foot in range(2):
        goes_on = stands[source, foot]
        if not stands[entry, foot] or (goes_on and entry == source + 1):
            continue
        a, b = _block(feet.blocks, entry, foot, state)
        if not (0 <= a < grid.shape[0] and 0 <= b < grid.shape[1]):
            return math.inf
        lift = grid[a, b] - levels[entry, foot] - state[LEVEL]
        if goes_on:
            # A jump: the foot stays on its block.
            old_a, old_b = _block(feet.blocks, source, foot, before)
            if old_a != a or old_b != b:
                return math.inf
            change = lift - state[LEFT + foot]
        else:
            change = lift - state[RIGHT - foot]
        if abs(change) > settings.max_level_change:
            return math.inf
        draw = _drawn(grid, a, b, feet.over[entry, foot], state[TURNS])
        if draw > settings.max_draw_m:
            return math.inf
        cost += _LEVEL_CHANGE * change * change + _DRAW * draw
        state[LEFT + foot] = lift
    return cost


@helper
def _root(planar, frame, state, block):
    """Where the root is: x, y [m] and yaw [rad]; `block` is the side of a block [m]."""
    x, y = planar[frame, 0], planar[frame, 1]
    for _ in range(state[TURNS]):
        x, y = -y, x
    yaw = planar[frame, 2] + 0.5 * math.pi * state[TURNS]
    return x + block * state[COLUMN], y + block * state[ROW], yaw


@helper
def _value(path, x, y, yaw, progress, away, spacing):
    """Eq. 8 to the end of the path [m]."""
    return eq_8(
        path, x, y, math.cos(yaw), math.sin(yaw), progress, len(path) - 1.0, away,
        _AHEAD_M, _FACING, spacing,
    )  # fmt: skip


@helper
def _key(frame, state):
    """One number for a frame and the column, row and turns of its clip."""
    key = np.int64(frame) * 4 + state[TURNS]
    key = key * _WRAP + state[COLUMN] + _BESIDE
    return key * _WRAP + state[ROW] + _BESIDE


@helper
def _trace(frames, parents, states, node):
    """Frames (k,) from the start to a node, without the start, and their placements (k, 4)."""
    length, ancestor = 0, node
    while ancestor > 0:
        length, ancestor = length + 1, parents[ancestor]
    out, placements = np.empty(length, np.int32), np.empty((length, 4), np.int64)
    for at in range(length - 1, -1, -1):
        out[at], placements[at] = frames[node], states[node, :LEFT]
        node = parents[node]
    return out, placements


@compiled(_FOUND(_INT, _WHOLES, _ROWS, _SETTINGS, _GRAPH, _FEET, _TABLE))
def search_kernel(start, begin, path, settings, graph, feet, grid):
    """Find a walk along a path, or to a goal.

    Args:
        start: Frame at which it begins.
        begin: (6,) state at which it begins; see `COLUMN`.
        path: (p, 2) points of the path, or the goal alone, from the grid's corner [m].
        settings: Limits and units.
        graph: The graph.
        feet: How its feet stand.
        grid: (columns, rows) levels of the blocks.
    """
    offsets, planar = graph.offsets, graph.planar
    last, spacing = len(path) - 1, settings.spacing_m
    room = 1 << 14
    frames, parents = np.empty(room, np.int32), np.empty(room, np.int64)
    states, ages = np.empty((room, STATE), np.int64), np.empty(room, np.int64)
    costs, done = np.empty(room), np.empty(room)
    best = Dict.empty(types.int64, types.float64)
    frames[0], parents[0], ages[0], costs[0] = start, -1, 1 << 20, 0.0
    states[0] = begin
    x, y, yaw = _root(planar, start, begin, settings.block_m)
    done[0], away = nearest_on(path, x, y, 0.0, settings.window)
    least = _value(path, x, y, yaw, done[0], away, spacing)
    best[_key(start, begin)] = 0.0
    heap = [(least, np.int64(0))]
    count, nearest, looked, arrived = 1, np.int64(0), 0, False
    state = np.empty(STATE, np.int64)
    while len(heap) > 0 and looked < settings.budget and not arrived:
        _, node = heapq.heappop(heap)
        frame = frames[node]
        if costs[node] > best[_key(frame, states[node])]:
            continue
        looked += 1
        for edge in range(offsets[frame], offsets[frame + 1]):
            entry = graph.targets[edge]
            _moved(states[node], graph.moves[edge], state)
            cost = _stand(grid, feet, entry, frame, states[node], state, settings)
            if cost == math.inf:
                continue
            age = ages[node] + 1
            if entry != frame + 1:
                soon = max(0.0, 1.0 - age * settings.frame_s / _HURRY_S)
                cost += _JUMP * graph.distances[edge] + _HURRY * soon
                age = 0
            x, y, yaw = _root(planar, entry, state, settings.block_m)
            progress, away = nearest_on(path, x, y, done[node], settings.window)
            stray = 0.0
            if last > 0:
                if away > _MAX_OFF_PATH_M:
                    continue
                stray = _STRAY * away * away
            cost += costs[node] + _PACE * settings.frame_s * (1.0 + stray)
            key = _key(entry, state)
            if key in best and best[key] <= cost:
                continue
            best[key] = cost
            value = _value(path, x, y, yaw, progress, away, spacing)
            if count == room:
                room *= 2
                frames, parents, ages = doubled(frames), doubled(parents), doubled(ages)
                costs, done, states = doubled(costs), doubled(done), doubled(states)
            frames[count], parents[count], ages[count] = entry, node, age
            states[count], costs[count], done[count] = state, cost, progress
            near = math.hypot(x - path[last, 0], y - path[last, 1]) <= settings.arrival_m
            arrived = near and progress >= last - settings.arrival_m / spacing
            if value < least or arrived:
                least, nearest = value, np.int64(count)
            heapq.heappush(heap, (cost + settings.greed * value, np.int64(count)))
            count += 1
            if arrived:
                break
    walked, placements = _trace(frames, parents, states, nearest)
    return FoundWalk(walked, placements, arrived, looked)
