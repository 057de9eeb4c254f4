"""The compiled search for ways over blocks on which every foot stands.

Importing this module compiles it (some seconds) or loads it from numba's cache; import it where it
is used.

A clip lies on the grid in whole blocks, whole levels and quarter turns, so where it is put is four
whole numbers: column, row, level, quarter turns. A foot that stands is a block and a level; the
level of the block that it comes to, less its own, is its lift. On the blocks that were recorded all
lifts are alike. A state is a frame with its placement and the lift of the last stance of each foot.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
from numba import types
from numba.typed import Dict

from dynresp.locomotion.worlds.path_kernel import eq_8, nearest_on
from dynresp.support.compiling import compiled, helper
from dynresp.support.growing_kernel import doubled

(
    PACE, STRAY, JUMP, HASTE, HURRY, STRETCH, DRAW, FACING, AHEAD, FARTHEST,
    ADAPT, REACH, SPACING, FRAME_TIME, BLOCK, ARRIVAL, GREED, WINDOW, SETTINGS,
) = range(19)  # fmt: skip
"""Entries of `settings`, and how many there are."""

COLUMN, ROW, LEVEL, TURNS, LEFT, RIGHT, PLACE = range(7)
"""Entries of a place: where a clip is put, then the lifts of both feet; and how many there are."""

# Room for one key: frames, and columns and rows from this far beside the grid.
_WRAP, _BESIDE = 1 << 20, 1 << 10

_FRAMES = types.Array(types.int32, 1, "C", readonly=True)
_WHOLES = types.Array(types.int64, 1, "C", readonly=True)
_COSTS = types.Array(types.float32, 1, "C", readonly=True)
_NUMBERS = types.Array(types.float64, 1, "C", readonly=True)
_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_TABLE = types.Array(types.int64, 2, "C", readonly=True)
_GRAPH = types.Tuple((_WHOLES, _FRAMES, _COSTS, _TABLE))
_FEET = types.Tuple(
    (
        types.Array(types.boolean, 2, "C", readonly=True),
        types.Array(types.int64, 3, "C", readonly=True),
        _TABLE,
        types.Array(types.float64, 3, "C", readonly=True),
    )
)


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
def _moved(place, move, out):
    """Put a clip where a way leads: its own placement, then the way's, in it."""
    a, b = move[0], move[1]
    for _ in range(place[TURNS]):
        a, b = -b, a
    out[COLUMN], out[ROW] = place[COLUMN] + a, place[ROW] + b
    out[LEVEL] = place[LEVEL] + move[2]
    out[TURNS] = (place[TURNS] + move[3]) % 4
    out[LEFT], out[RIGHT] = place[LEFT], place[RIGHT]


@helper
def _block(cells, frame, foot, place):
    """Column and row of the block on which a foot stands."""
    a, b = _turned(cells[frame, foot, 0], cells[frame, foot, 1], place[TURNS])
    return a + place[COLUMN], b + place[ROW]


@helper
def _level_at(grid, a, b, otherwise):
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
def _stand(grid, feet, entry, left, before, place, settings):
    """Go from a frame to the next.

    Args:
        grid: Levels of the blocks.
        feet: How feet stand: `stands`, `blocks`, `levels` and `over` of `TerrainGraph`.
        entry: The frame entered.
        left: The frame left.
        before: Its place.
        place: The place of the frame entered; its lifts are those of the frame left, and are
            brought up to the one entered.
        settings: See `SETTINGS`.

    Returns:
        What the stances that begin cost [m], infinite where a foot does not stand.
    """
    stands, cells, levels, over = feet
    cost = 0.0
    for foot in range(2):
        goes_on = stands[left, foot]
        if not stands[entry, foot] or (goes_on and entry == left + 1):
            continue
        a, b = _block(cells, entry, foot, place)
        if not (0 <= a < grid.shape[0] and 0 <= b < grid.shape[1]):
            return math.inf
        lift = grid[a, b] - levels[entry, foot] - place[LEVEL]
        if goes_on:
            # A jump: the foot stays on its block.
            old_a, old_b = _block(cells, left, foot, before)
            if old_a != a or old_b != b:
                return math.inf
            change = lift - place[LEFT + foot]
        else:
            change = lift - place[RIGHT - foot]
        if abs(change) > settings[ADAPT]:
            return math.inf
        draw = _drawn(grid, a, b, over[entry, foot], place[TURNS])
        if draw > settings[REACH]:
            return math.inf
        cost += settings[STRETCH] * change * change + settings[DRAW] * draw
        place[LEFT + foot] = lift
    return cost


@helper
def _root(planar, frame, place, block):
    """Where the root is: x, y and yaw."""
    x, y = planar[frame, 0], planar[frame, 1]
    for _ in range(place[TURNS]):
        x, y = -y, x
    yaw = planar[frame, 2] + 0.5 * math.pi * place[TURNS]
    return x + block * place[COLUMN], y + block * place[ROW], yaw


@helper
def _value(path, x, y, yaw, progress, away, settings):
    """Eq. 8 to the end of the path [m]."""
    return eq_8(
        path, x, y, math.cos(yaw), math.sin(yaw), progress, len(path) - 1.0, away,
        settings[AHEAD], settings[FACING], settings[SPACING],
    )  # fmt: skip


@helper
def _key(frame, place):
    """One number for a frame and where on the grid its clip is put."""
    key = np.int64(frame) * 4 + place[TURNS]
    key = key * _WRAP + place[COLUMN] + _BESIDE
    return key * _WRAP + place[ROW] + _BESIDE


@compiled(
    types.Tuple((types.int32[::1], types.int64[:, ::1]))(
        types.int64, _WHOLES, _NUMBERS, _ROWS, types.int64, _GRAPH, _ROWS, _FEET, _TABLE,
        types.int64[::1],
    )
)  # fmt: skip
def search_kernel(start, begin, settings, path, budget, graph, planar, feet, grid, told):
    """Find a way along a path.

    Args:
        start: The frame it begins at.
        begin: (6,) its place.
        settings: See `SETTINGS`.
        path: (p, 2) points SPACING apart, or the goal alone [m], from the grid's corner.
        budget: Most states to go on from.
        graph: Offsets, targets, distances and moves (m, 4) of the graph.
        planar: (n, 3) x, y and yaw of the roots.
        feet: See `_stand`.
        grid: Levels of the blocks.
        told: Out: whether it arrived, and the states gone on from.

    Returns:
        (k,) frames after the start, and (k, 4) their placements.
    """
    offsets, targets, distances, moves = graph
    last = len(path) - 1
    room = 1 << 14
    frames, parents = np.empty(room, np.int32), np.empty(room, np.int64)
    places, ages = np.empty((room, PLACE), np.int64), np.empty(room, np.int64)
    costs, done = np.empty(room), np.empty(room)
    best = Dict.empty(types.int64, types.float64)
    frames[0], parents[0], ages[0], costs[0] = start, -1, 1 << 20, 0.0
    places[0] = begin
    x, y, yaw = _root(planar, start, begin, settings[BLOCK])
    done[0], away = nearest_on(path, x, y, 0.0, settings[WINDOW])
    least = _value(path, x, y, yaw, done[0], away, settings)
    best[_key(start, begin)] = 0.0
    heap = [(least, np.int64(0))]
    count, nearest, looked, arrived = 1, np.int64(0), 0, False
    place = np.empty(PLACE, np.int64)
    while len(heap) > 0 and looked < budget and not arrived:
        _, node = heapq.heappop(heap)
        frame = frames[node]
        if costs[node] > best[_key(frame, places[node])]:
            continue
        looked += 1
        for way in range(offsets[frame], offsets[frame + 1]):
            entry = targets[way]
            _moved(places[node], moves[way], place)
            cost = _stand(grid, feet, entry, frame, places[node], place, settings)
            if cost == math.inf:
                continue
            age = ages[node] + 1
            if entry != frame + 1:
                soon = max(0.0, 1.0 - age * settings[FRAME_TIME] / settings[HASTE])
                cost += settings[JUMP] * distances[way] + settings[HURRY] * soon
                age = 0
            x, y, yaw = _root(planar, entry, place, settings[BLOCK])
            progress, away = nearest_on(path, x, y, done[node], settings[WINDOW])
            stray = 0.0
            if last > 0:
                if away > settings[FARTHEST]:
                    continue
                stray = settings[STRAY] * away * away
            cost += costs[node] + settings[PACE] * settings[FRAME_TIME] * (1.0 + stray)
            key = _key(entry, place)
            if key in best and best[key] <= cost:
                continue
            best[key] = cost
            value = _value(path, x, y, yaw, progress, away, settings)
            if count == room:
                room *= 2
                frames, parents, ages = doubled(frames), doubled(parents), doubled(ages)
                costs, done, places = doubled(costs), doubled(done), doubled(places)
            frames[count], parents[count], ages[count] = entry, node, age
            places[count], costs[count], done[count] = place, cost, progress
            near = math.hypot(x - path[last, 0], y - path[last, 1]) <= settings[ARRIVAL]
            arrived = near and progress >= last - settings[ARRIVAL] / settings[SPACING]
            if value < least or arrived:
                least, nearest = value, np.int64(count)
            heapq.heappush(heap, (cost + settings[GREED] * value, np.int64(count)))
            count += 1
            if arrived:
                break
    told[0], told[1] = arrived, looked
    length, node = 0, nearest
    while node > 0:
        length, node = length + 1, parents[node]
    out, where = np.empty(length, np.int32), np.empty((length, 4), np.int64)
    node = nearest
    for at in range(length - 1, -1, -1):
        out[at], where[at] = frames[node], places[node, :LEFT]
        node = parents[node]
    return out, where
