"""The heap and the table of the compiled search."""

from __future__ import annotations

import math

import numpy as np

from dynresp.support.compiling import helper

# Cells before their numbers begin anew.
_WRAP = 1 << 14


@helper
def sift_up(costs, ways, at):
    """Bring the last entry of a heap to its place; of equal costs the lower way comes first."""
    cost, way = costs[at], ways[at]
    while at > 0:
        above = (at - 1) >> 1
        if costs[above] < cost or (costs[above] == cost and ways[above] <= way):
            break
        costs[at], ways[at] = costs[above], ways[above]
        at = above
    costs[at], ways[at] = cost, way


@helper
def sift_down(costs, ways, size):
    """Bring the first entry of a heap to its place."""
    cost, way, at = costs[0], ways[0], 0
    while True:
        below = 2 * at + 1
        if below >= size:
            break
        other = below + 1
        if other < size and (
            costs[other] < costs[below]
            or (costs[other] == costs[below] and ways[other] < ways[below])
        ):
            below = other
        if cost < costs[below] or (cost == costs[below] and way <= ways[below]):
            break
        costs[at], ways[at] = costs[below], ways[below]
        at = below
    costs[at], ways[at] = cost, way


@helper
def slot_of(keys, key):
    """Where a key is, or belongs, in a table with open addresses; -1 marks what is empty."""
    mask = len(keys) - 1
    at = ((key * 0x9E3779B97F4A7C1) >> 20) & mask
    while keys[at] != -1 and keys[at] != key:
        at = (at + 1) & mask
    return at


@helper
def number(frame, x, y, yaw, done):
    """Cells as one number; far places may share it."""
    column = np.int64(math.floor(x)) & (_WRAP - 1)
    row = np.int64(math.floor(y)) & (_WRAP - 1)
    return (((np.int64(frame) * _WRAP + column) * _WRAP + row) * 32 + np.int64(yaw)) * 8 + done
