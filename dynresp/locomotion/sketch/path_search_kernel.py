"""The compiled best-first search through a motion graph along a path.

Importing this module compiles it (some seconds) or loads it from numba's cache; import it where it
is used.

A state is a frame from which several ways lead, the placement of its clip, and how much of the
path is done. Taking a way plays all frames up to the next such frame. What waits in the heap is a
way of a state and its cost; only when it is the best is it played again, tested for collisions
frame by frame, and made a state of its own. Tested is what will be seen: the poses as they are
blended, which may reach farther than any of the recorded ones.
"""

from __future__ import annotations

import math

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
from dynresp.support.compiling import compiled, helper
from dynresp.support.growing_kernel import doubled

(
    PACE, STRAY, JUMP, AHEAD, FARTHEST, MARGIN, SPACING, FRAME_TIME, BLEND, BLEND_RATE,
    TARGET, REACHED, RADIUS, WINDOW, SETTINGS,
) = range(15)  # fmt: skip
"""Entries of `settings` of `search_kernel`, and how many there are."""

X, Y, YAW, PROGRESS, COST = range(5)
"""Entries of a state: placement of its clip, points of the path done, and cost so far."""

PLACE, OFFSET, RATE, AGE, PLAYED = 0, 4, 49, 94, 95
"""Where in a row of `playing` the arrays of `play_kernel` begin, and how long it is."""

# Places that count as the same: as one state, and as one neighbourhood [m, rad].
_NEAR, _NEAR_TURN = 0.1, math.pi / 12
_AROUND, _AROUND_TURN = 0.25, math.pi / 6
# Progress that makes it another visit [m]; ways that begin this near to the arrival are all played.
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
        the way leads too far off.
    """
    cosine, sine = math.cos(state[YAW]), math.sin(state[YAW])
    step = settings[PACE] * settings[FRAME_TIME]
    last = len(path) - 1
    for frame in range(entry, stop + 1):
        x = state[X] + cosine * planar[frame, 0] - sine * planar[frame, 1]
        y = state[Y] + sine * planar[frame, 0] + cosine * planar[frame, 1]
        state[PROGRESS], away = nearest_on(path, x, y, state[PROGRESS], settings[WINDOW])
        if away > settings[FARTHEST]:
            return -1, math.inf
        state[COST] += step * (1.0 + settings[STRAY] * away * away)
        arrived = (
            state[PROGRESS] >= settings[REACHED]
            and still[frame]
            and math.hypot(x - path[last, 0], y - path[last, 1]) <= settings[RADIUS]
        )
        if arrived or frame == stop:
            yaw = state[YAW] + planar[frame, 2]
            # The lesser first: what is too large for an integer is none when cut off.
            at = int(min(state[PROGRESS] + settings[AHEAD] / settings[SPACING], last - 1.0))
            value = eq_8(
                path, x, y, math.cos(yaw), math.sin(yaw), state[PROGRESS], settings[TARGET], away,
                settings[AHEAD], facing[at], settings[SPACING],
            )  # fmt: skip
            return (frame if arrived else -1), value
    return -1, math.inf


@helper
def _enter(state, placement):
    """Put the clip of a state where a way leads: its own placement, then the way's, in it."""
    cosine, sine = math.cos(state[YAW]), math.sin(state[YAW])
    state[X] += cosine * placement[0] - sine * placement[1]
    state[Y] += sine * placement[0] + cosine * placement[1]
    state[YAW] += placement[3]


@helper
def _free(entry, stop, state, planar, feet, grid):
    """Whether no footprint of the frames entry to stop, as recorded, touches a box."""
    corner, clearance, starts, members, boxes = grid
    cosine, sine = math.cos(state[YAW]), math.sin(state[YAW])
    for frame in range(entry, stop + 1):
        x = state[X] + cosine * planar[frame, 0] - sine * planar[frame, 1]
        y = state[Y] + sine * planar[frame, 0] + cosine * planar[frame, 1]
        yaw = state[YAW] + planar[frame, 2]
        if collides(
            x, y, math.cos(yaw), math.sin(yaw), feet[frame], 0.0,
            corner, clearance, starts, members, boxes,
        ):  # fmt: skip
            return False
    return True


@helper
def _plays_free(left, entry, stop, move, motion, playing, body, grid, settings):
    """Play frames entry to stop after another; whether no pose of them touches a box.

    `playing` is brought up to where it ends.
    """
    poses, velocities = motion
    corner, clearance, starts, members, boxes = grid
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
        BlendTimes(1.0 / settings[FRAME_TIME], settings[BLEND], settings[BLEND_RATE]),
        Blend(playing[PLACE:OFFSET], playing[OFFSET:RATE], playing[RATE:AGE], playing[AGE:PLAYED]),
        PlayedRows(played, np.empty((count, 4)), np.empty((count, 45))),
    )
    states = (1, len(body[0]))
    positions, centers = np.empty((*states, 3)), np.empty((*states, 3))
    quaternions, nowhere = np.empty((*states, 4)), np.zeros((len(body[0]), 3))
    feet = np.empty(4)
    for k in range(count):
        pose = played[k]
        kinematics_kernel(
            played[k : k + 1], body[0], body[1], nowhere, positions, quaternions, centers
        )
        footprint(pose, positions[0], quaternions[0], body, feet)
        yaw = 2.0 * math.atan2(pose[6], pose[3])
        if collides(
            pose[0], pose[1], math.cos(yaw), math.sin(yaw), feet, settings[MARGIN],
            corner, clearance, starts, members, boxes,
        ):  # fmt: skip
            return False
    return True


@helper
def _places(frame, state, planar, settings):
    """Two numbers for where a frame's root is: states at one place, and in one neighbourhood.

    The progress of the state from which a way leads tells apart a path's visits to one place.
    """
    cosine, sine = math.cos(state[YAW]), math.sin(state[YAW])
    x = state[X] + cosine * planar[frame, 0] - sine * planar[frame, 1]
    y = state[Y] + sine * planar[frame, 0] + cosine * planar[frame, 1]
    yaw = (state[YAW] + planar[frame, 2]) % (2.0 * math.pi)
    done = np.int64(state[PROGRESS] * settings[SPACING] / _VISIT) & 7
    key = number(frame, x / _NEAR, y / _NEAR, yaw / _NEAR_TURN, done)
    return key, number(0, x / _AROUND, y / _AROUND, yaw / _AROUND_TURN, done)


_FOUND = types.Tuple((types.int64[::1], types.float64[::1], types.float64[:, ::1]))


@compiled(
    _FOUND(
        types.int64, REALS, REALS, REALS, ROWS, REALS, types.int64, types.int64,
        _OFFSETS, _FRAMES, _COSTS, ROWS, ROWS, _FRAMES, _FLAGS, FOOTPRINTS,
        types.UniTuple(ROWS, 2), types.Tuple(BODY), types.Tuple(GRID), types.int64[::1],
    )
)  # fmt: skip
def search_kernel(
    start, begin, playing, settings, path, facing, budget, crowded,
    offsets, targets, distances, placements, planar, ends, still, feet,
    motion, body, grid, told,
):  # fmt: skip
    """Find the best way from a state along a path.

    Args:
        start: Frame of the state.
        begin: (5,) the state; see `X`.
        playing: (PLAYED,) how it was played; see `PLACE`.
        settings: (SETTINGS,) lengths in metres, angles in radians, see `SearchConfig`; TARGET and
            REACHED are in points of the path: where eq. 8 looks to, and from where on a frame
            counts as an arrival if it is within RADIUS of the path's last point. WINDOW is that of
            `nearest_on`.
        path: (p, 2) points SPACING apart, at least two [m].
        facing: (p,) c of eq. 8 along the path.
        budget: Most ways to look at.
        crowded: Most states in one neighbourhood.
        offsets: (n + 1,) rows of ways, see `MotionGraph`.
        targets: (m,).
        distances: (m,).
        placements: (m, 4).
        planar: (n, 3) x, y and yaw of the roots.
        ends: (n,) the first frame from each on, itself included, from which other ways lead than
            the recorded one.
        still: (n,) frames at which a walk may arrive.
        feet: (n, 4) footprints.
        motion: (n, 59) poses and (n, 45) velocities.
        body: Of `body_arrays`.
        grid: Arrays of a `CollisionGrid`; without boxes nothing is played or tested.
        told: Out, (3,) the frame of arrival, or -1 where none was found and the ways lead to the
            state with the least value of eq. 8; ways looked at; ways that collided.

    Returns:
        The ways (k,); how much of the path is done after each (k,) [points]; how it was played up
        to there (k, PLAYED).
    """
    states, played = np.empty((64, 5)), np.empty((64, PLAYED))
    frames, parents, taken = np.empty(64, np.int64), np.empty(64, np.int64), np.empty(64, np.int64)
    states[0], played[0] = begin, playing
    frames[0], parents[0], taken[0] = start, -1, -1
    boxes = grid[4]
    known, best, least, arrival, collided = 1, 0, math.inf, np.int64(-1), 0

    size, costs, ways = 0, np.empty(4096), np.empty(4096, np.int64)
    room = 1024
    while room < 3 * budget:
        room *= 2
    seen, around = np.full(room, -1, np.int64), np.full(room, -1, np.int64)
    crowd = np.zeros(room, np.int64)
    state, now = np.empty(5), np.zeros(PLAYED)

    looked, node = 0, 0
    while True:
        # Offer all ways of the state.
        frame = frames[node]
        for way in range(offsets[frame], offsets[frame + 1]):
            state[:] = states[node]
            _enter(state, placements[way])
            entry = targets[way]
            # What leads to no new place need not be played, unless it may arrive before.
            if settings[REACHED] - states[node, PROGRESS] > _ARRIVING / settings[SPACING]:
                key, near = _places(ends[entry], state, planar, settings)
                if seen[slot_of(seen, key)] == key or crowd[slot_of(around, near)] >= crowded:
                    continue
            _, value = _play(entry, ends[entry], state, planar, still, path, facing, settings)
            if value == math.inf:
                continue
            if size == len(costs):
                costs, ways = doubled(costs), doubled(ways)
            costs[size] = state[COST] + settings[JUMP] * distances[way] + value
            ways[size] = (np.int64(node) << 32) | way
            sift_up(costs, ways, size)
            size += 1
        # Take the best one that is free and new.
        node = -1
        while size > 0 and looked < budget:
            parent, way = ways[0] >> 32, ways[0] & 0xFFFFFFFF
            size -= 1
            costs[0], ways[0] = costs[size], ways[size]
            sift_down(costs, ways, size)
            looked += 1
            state[:] = states[parent]
            _enter(state, placements[way])
            entry = targets[way]
            key, near = _places(ends[entry], state, planar, settings)
            slot, slot_near = slot_of(seen, key), slot_of(around, near)
            may_arrive = settings[REACHED] - state[PROGRESS] <= _ARRIVING / settings[SPACING]
            is_old = seen[slot] == key or crowd[slot_near] >= crowded
            if is_old and not may_arrive:
                continue
            arrived, value = _play(entry, ends[entry], state, planar, still, path, facing, settings)
            if is_old and arrived < 0:
                continue
            state[COST] += settings[JUMP] * distances[way]
            stop = ends[entry] if arrived < 0 else arrived
            if len(boxes) > 0:
                now[:] = played[parent]
                if not (
                    _free(entry, stop, state, planar, feet, grid)
                    and _plays_free(
                        frames[parent], entry, stop, placements[way], motion, now, body, grid,
                        settings,
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
            frames[node], parents[node], taken[node] = stop, parent, way
            known += 1
            arrival = arrived
            if value < least:
                least, best = value, node
            break
        if node < 0 or arrival >= 0:
            break
    if arrival < 0:
        node = best
    told[0], told[1], told[2] = arrival, looked, collided
    length, back = 0, node
    while parents[back] >= 0:
        length += 1
        back = parents[back]
    chain, done, rows = np.empty(length, np.int64), np.empty(length), np.empty((length, PLAYED))
    back = node
    for k in range(length - 1, -1, -1):
        chain[k], done[k], rows[k] = taken[back], states[back, PROGRESS], played[back]
        back = parents[back]
    return chain, done, rows
