"""Compiled best-first search through a motion graph along a path.

Importing this module imports numba; so import it where it is used.

A state is a frame with several edges, the placement of its clip, and the progress along the path.
Following an edge plays all frames up to the next such frame. The heap holds edges that leave a
state, with their costs; only the best of them is played again, tested for collisions frame by
frame, and made a state of its own. The test uses what will be seen: the poses after blending, which
may reach farther than any recorded one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from dynresp.locomotion.playing.blending_kernel import (
    Blend,
    BlendTimes,
    PlayedRows,
    Recording,
    Steps,
    play_kernel,
)
from dynresp.locomotion.sketch.path_search_heap_kernel import number, sift_down, sift_up, slot_of
from dynresp.locomotion.worlds.collision_kernel import (
    FOOTPRINTS,
    GRID,
    REALS,
    ROWS,
    collides,
)
from dynresp.locomotion.worlds.footprint_kernel import BODY, footprint
from dynresp.locomotion.worlds.path_kernel import eq_8, nearest_on
from dynresp.motion.kinematics_kernel import kinematics_kernel
from dynresp.support.array_growth_kernel import doubled
from dynresp.support.compiling import compiled, helper


class SearchSettings(NamedTuple):
    """Costs and limits of a search; see `dynresp.locomotion.sketch.path_search`.

    Attributes:
        pace: Cost of a second [m].
        stray: Factor of the squared distance to the path in the cost of a second [1/m^2].
        jump: Cost of a jump per unit of its distance [m].
        ahead_m: Distance along the path to the point that the avatar should face [m].
        max_off_path_m: Edges that lead farther from the path are dropped [m].
        margin_m: Footprints are widened by this [m].
        spacing_m: Distance of the points of the path [m].
        frame_s: Time of a frame [s].
        blend_s: Time over which a displacement decays [s].
        blend_rate_s: Time over which the rate of joints decays [s].
        target: Progress at which eq. 8 looks [points].
        arrival: Progress from which on a frame may be an arrival [points].
        arrival_m: Farthest that an arrival may be from the last point of the path [m].
        window: Points of the path that `nearest_on` looks at.
        budget: Most edges to take from the heap.
        crowded: Most states in one neighbourhood.
    """

    pace: Any
    stray: Any
    jump: Any
    ahead_m: Any
    max_off_path_m: Any
    margin_m: Any
    spacing_m: Any
    frame_s: Any
    blend_s: Any
    blend_rate_s: Any
    target: Any
    arrival: Any
    arrival_m: Any
    window: Any
    budget: Any
    crowded: Any


class SearchArrays(NamedTuple):
    """A motion graph as the search needs it; see `MotionGraph` and `SearchGraph`. Read-only.

    Attributes:
        offsets: (n + 1,) int64, where the row of edges of each frame begins.
        targets: (m,) int32.
        distances: (m,) float32.
        placements: (m, 4).
        planar: (n, 3) x, y and yaw of the roots [m, rad].
        ends: (n,) int32, the first frame from each on, itself included, that does not just go on.
        still: (n,) bool, frames at which a walk may arrive.
        footprints: (n, 4) float32.
        poses: (n, 59).
        velocities: (n, 45).
    """

    offsets: Any
    targets: Any
    distances: Any
    placements: Any
    planar: Any
    ends: Any
    still: Any
    footprints: Any
    poses: Any
    velocities: Any


class SearchResult(NamedTuple):
    """What a search found.

    Attributes:
        edges: (k,) int64, those to follow from the start.
        progress: (k,) progress along the path after each [points].
        played: (k, PLAYED) how the pose was played up to there.
        arrival: Frame of arrival; -1 where there is none, and the edges lead to the state with the
            least value of eq. 8.
        looked: Edges that were taken from the heap.
        collided: Those among them that were dropped for a collision.
    """

    edges: Any
    progress: Any
    played: Any
    arrival: Any
    looked: Any
    collided: Any


X, Y, YAW, PROGRESS, COST = range(5)
"""Columns of a state: placement of its clip [m, rad], progress [points], and cost so far [m]."""

PLACE, OFFSET, RATE, AGE, PLAYED = 0, 4, 49, 94, 95
"""Where the arrays of `play_kernel` begin in a row of played states, and the row's length."""

# Sizes of cells: roots in one small cell are one state, in one large cell a neighbourhood [m, rad].
_NEAR, _NEAR_TURN = 0.1, math.pi / 12
_AROUND, _AROUND_TURN = 0.25, math.pi / 6
# Progress after which a return to a cell counts as new [m]; edges this near to the arrival are
# all played [m].
_VISIT, _ARRIVING = 1.0, 1.5

_FRAMES = types.Array(types.int32, 1, "C", readonly=True)
_OFFSETS = types.Array(types.int64, 1, "C", readonly=True)
_FLAGS = types.Array(types.boolean, 1, "C", readonly=True)
_COSTS = types.Array(types.float32, 1, "C", readonly=True)


@helper
def _play(entry, stop, state, planar, still, path, facing, settings):
    """Play frames entry to stop of a clip, and bring its state up to there.

    Returns:
        The frame of arrival, or -1, and eq. 8 at the last frame played; that is infinite where
        the frames lead too far from the path.
    """
    cosine, sine = math.cos(state[YAW]), math.sin(state[YAW])
    step = settings.pace * settings.frame_s
    last = len(path) - 1
    for frame in range(entry, stop + 1):
        x = state[X] + cosine * planar[frame, 0] - sine * planar[frame, 1]
        y = state[Y] + sine * planar[frame, 0] + cosine * planar[frame, 1]
        state[PROGRESS], away = nearest_on(path, x, y, state[PROGRESS], settings.window)
        if away > settings.max_off_path_m:
            return -1, math.inf
        state[COST] += step * (1.0 + settings.stray * away * away)
        arrived = (
            state[PROGRESS] >= settings.arrival
            and still[frame]
            and math.hypot(x - path[last, 0], y - path[last, 1]) <= settings.arrival_m
        )
        if arrived or frame == stop:
            yaw = state[YAW] + planar[frame, 2]
            # Take the minimum first: a float above the integers' range does not convert.
            at = int(min(state[PROGRESS] + settings.ahead_m / settings.spacing_m, last - 1.0))
            value = eq_8(
                path, x, y, math.cos(yaw), math.sin(yaw), state[PROGRESS], settings.target, away,
                settings.ahead_m, facing[at], settings.spacing_m,
            )  # fmt: skip
            return (frame if arrived else -1), value
    return -1, math.inf


@helper
def _enter(state, placement):
    """Move the clip of a state along an edge: its own placement, then that of the edge in it."""
    cosine, sine = math.cos(state[YAW]), math.sin(state[YAW])
    state[X] += cosine * placement[0] - sine * placement[1]
    state[Y] += sine * placement[0] + cosine * placement[1]
    state[YAW] += placement[3]


@helper
def _free(entry, stop, state, planar, feet, grid):
    """Whether no footprint of the frames entry to stop, as recorded, touches a box."""
    cosine, sine = math.cos(state[YAW]), math.sin(state[YAW])
    for frame in range(entry, stop + 1):
        x = state[X] + cosine * planar[frame, 0] - sine * planar[frame, 1]
        y = state[Y] + sine * planar[frame, 0] + cosine * planar[frame, 1]
        yaw = state[YAW] + planar[frame, 2]
        if collides(
            x, y, math.cos(yaw), math.sin(yaw), feet[frame], 0.0, grid
        ):  # fmt: skip
            return False
    return True


@helper
def _plays_free(left, entry, stop, move, poses, velocities, playing, body, grid, settings):
    """Play frames entry to stop after another; whether none of their poses touches a box.

    `playing` is updated to the last of them.
    """
    count = stop - entry + 1
    frames = np.empty(count + 1, np.int32)
    frames[0] = left
    jumps, moves = np.zeros(count, np.bool_), np.zeros((count, 4))
    for k in range(count):
        frames[k + 1] = entry + k
    jumps[0] = entry != left + 1
    moves[0] = move
    played = np.empty((count, 59))
    play_kernel(
        Recording(poses, velocities),
        Steps(frames, jumps, moves),
        BlendTimes(1.0 / settings.frame_s, settings.blend_s, settings.blend_rate_s),
        Blend(playing[PLACE:OFFSET], playing[OFFSET:RATE], playing[RATE:AGE], playing[AGE:PLAYED]),
        PlayedRows(played, np.empty((count, 4)), np.empty((count, 45))),
    )
    bodies = len(body.parents)
    states = (1, bodies)
    positions, centers = np.empty((*states, 3)), np.empty((*states, 3))
    quaternions, nowhere = np.empty((*states, 4)), np.zeros((bodies, 3))
    feet = np.empty(4)
    for k in range(count):
        pose = played[k]
        kinematics_kernel(
            played[k : k + 1], body.parents, body.offsets, nowhere, positions, quaternions,
            centers,
        )  # fmt: skip
        footprint(pose, positions[0], quaternions[0], body, feet)
        yaw = 2.0 * math.atan2(pose[6], pose[3])
        if collides(
            pose[0], pose[1], math.cos(yaw), math.sin(yaw), feet, settings.margin_m, grid
        ):  # fmt: skip
            return False
    return True


@helper
def _cells(frame, state, planar, settings):
    """The numbers of the small and of the large cell in which a frame's root is.

    They contain the progress of the state, as a path may visit a cell several times.
    """
    cosine, sine = math.cos(state[YAW]), math.sin(state[YAW])
    x = state[X] + cosine * planar[frame, 0] - sine * planar[frame, 1]
    y = state[Y] + sine * planar[frame, 0] + cosine * planar[frame, 1]
    yaw = (state[YAW] + planar[frame, 2]) % (2.0 * math.pi)
    done = np.int64(state[PROGRESS] * settings.spacing_m / _VISIT) & 7
    key = number(frame, x / _NEAR, y / _NEAR, yaw / _NEAR_TURN, done)
    return key, number(0, x / _AROUND, y / _AROUND, yaw / _AROUND_TURN, done)


_REAL, _INT = types.float64, types.int64
_SETTINGS = types.NamedTuple((*[_REAL] * 14, _INT, _INT), SearchSettings)
_GRAPH = types.NamedTuple(
    (_OFFSETS, _FRAMES, _COSTS, ROWS, ROWS, _FRAMES, _FLAGS, FOOTPRINTS, ROWS, ROWS), SearchArrays
)
_RESULT = types.NamedTuple((_INT[::1], _REAL[::1], _REAL[:, ::1], _INT, _INT, _INT), SearchResult)


@compiled(_RESULT(_INT, REALS, REALS, _SETTINGS, _GRAPH, ROWS, REALS, BODY, GRID))
def search_kernel(start, begin, playing, settings, graph, path, facing, body, grid):
    """Find the best sequence of edges from a state along a path.

    Args:
        start: Frame of the state.
        begin: (5,) the state; see `X`.
        playing: (PLAYED,) how it was played; see `PLACE`.
        settings: Costs and limits.
        graph: The graph.
        path: (p, 2) points, at least two [m].
        facing: (p,) c of eq. 8 along the path.
        body: `BodyShape`.
        grid: `Grid`; without boxes nothing is played or tested.
    """
    offsets, targets, distances = graph.offsets, graph.targets, graph.distances
    placements, planar, ends, still = graph.placements, graph.planar, graph.ends, graph.still
    budget, crowded = settings.budget, settings.crowded
    states, played = np.empty((64, 5)), np.empty((64, PLAYED))
    frames, parents, taken = np.empty(64, np.int64), np.empty(64, np.int64), np.empty(64, np.int64)
    states[0], played[0] = begin, playing
    frames[0], parents[0], taken[0] = start, -1, -1
    boxes = grid.boxes
    known, best, least, arrival, collided = 1, 0, math.inf, np.int64(-1), 0

    size, costs, edges = 0, np.empty(4096), np.empty(4096, np.int64)
    room = 1024
    while room < 3 * budget:
        room *= 2
    seen, around = np.full(room, -1, np.int64), np.full(room, -1, np.int64)
    crowd = np.zeros(room, np.int64)
    state, now = np.empty(5), np.zeros(PLAYED)

    looked, node = 0, 0
    while True:
        # Put all edges of the state into the heap.
        frame = frames[node]
        for edge in range(offsets[frame], offsets[frame + 1]):
            state[:] = states[node]
            _enter(state, placements[edge])
            entry = targets[edge]
            # An edge to a known cell need not be played, unless it may arrive before.
            if settings.arrival - states[node, PROGRESS] > _ARRIVING / settings.spacing_m:
                key, near = _cells(ends[entry], state, planar, settings)
                if seen[slot_of(seen, key)] == key or crowd[slot_of(around, near)] >= crowded:
                    continue
            _, value = _play(entry, ends[entry], state, planar, still, path, facing, settings)
            if value == math.inf:
                continue
            if size == len(costs):
                costs, edges = doubled(costs), doubled(edges)
            costs[size] = state[COST] + settings.jump * distances[edge] + value
            edges[size] = (np.int64(node) << 32) | edge
            sift_up(costs, edges, size)
            size += 1
        # Take the best one that is free and new.
        node = -1
        while size > 0 and looked < budget:
            parent, edge = edges[0] >> 32, edges[0] & 0xFFFFFFFF
            size -= 1
            costs[0], edges[0] = costs[size], edges[size]
            sift_down(costs, edges, size)
            looked += 1
            state[:] = states[parent]
            _enter(state, placements[edge])
            entry = targets[edge]
            key, near = _cells(ends[entry], state, planar, settings)
            slot, slot_near = slot_of(seen, key), slot_of(around, near)
            may_arrive = settings.arrival - state[PROGRESS] <= _ARRIVING / settings.spacing_m
            is_old = seen[slot] == key or crowd[slot_near] >= crowded
            if is_old and not may_arrive:
                continue
            arrived, value = _play(entry, ends[entry], state, planar, still, path, facing, settings)
            if is_old and arrived < 0:
                continue
            state[COST] += settings.jump * distances[edge]
            stop = ends[entry] if arrived < 0 else arrived
            if len(boxes) > 0:
                now[:] = played[parent]
                if not (
                    _free(entry, stop, state, planar, graph.footprints, grid)
                    and _plays_free(
                        frames[parent], entry, stop, placements[edge], graph.poses,
                        graph.velocities, now, body, grid, settings,
                    )
                ):  # fmt: skip
                    collided += 1
                    continue
            if known == len(frames):
                states, played = doubled(states), doubled(played)
                frames, parents, taken = doubled(frames), doubled(parents), doubled(taken)
            seen[slot] = key
            around[slot_near] = near
            crowd[slot_near] += 1
            node = known
            states[node], played[node] = state, now
            frames[node], parents[node], taken[node] = stop, parent, edge
            known += 1
            arrival = arrived
            if value < least:
                least, best = value, node
            break
        if node < 0 or arrival >= 0:
            break
    if arrival < 0:
        node = best
    length, back = 0, node
    while parents[back] >= 0:
        length += 1
        back = parents[back]
    chain, done, rows = np.empty(length, np.int64), np.empty(length), np.empty((length, PLAYED))
    back = node
    for k in range(length - 1, -1, -1):
        chain[k], done[k], rows[k] = taken[back], states[back, PROGRESS], played[back]
        back = parents[back]
    return SearchResult(chain, done, rows, arrival, looked, collided)
