"""Heap and hash table of the compiled search along a path."""

from __future__ import annotations

import math

import numpy as np

from dynresp.support.compiling import helper

# So many cells to a side before their numbers repeat.
_WRAP = 1 << 14


@helper
def sift_up(costs, edges, at):
    """Move the last entry of a heap up; of equal costs the lower edge comes first."""
    cost, edge = costs[at], edges[at]
    while at > 0:
        above = (at - 1) >> 1
        if costs[above] < cost or (costs[above] == cost and edges[above] <= edge):
            break
        costs[at], edges[at] = costs[above], edges[above]
        at = above
    costs[at], edges[at] = cost, edge


@helper
def sift_down(costs, edges, size):
    """Move the first entry of a heap down."""
    cost, edge, at = costs[0], edges[0], 0
    while True:
        below = 2 * at + 1
        if below >= size:
            break
        other = below + 1
        if other < size and (
            costs[other] < costs[below]
            or (costs[other] == costs[below] and edges[other] < edges[below])
        ):
            below = other
        if cost < costs[below] or (cost == costs[below] and edge <= edges[below]):
            break
        costs[at], edges[at] = costs[below], edges[below]
        at = below
    costs[at], edges[at] = cost, edge


@helper
def slot_of(keys, key):
    """Index of a key, or where it belongs, in a table with open addressing; -1 marks free slots."""
    mask = len(keys) - 1
    at = ((key * 0x9E3779B97F4A7C1) >> 20) & mask
    while keys[at] != -1 and keys[at] != key:
        at = (at + 1) & mask
    return at


@helper
def number(frame, x, y, yaw, done):
    """One number for a cell; distant cells may share it."""
    column = np.int64(math.floor(x)) & (_WRAP - 1)
    row = np.int64(math.floor(y)) & (_WRAP - 1)
    return (((np.int64(frame) * _WRAP + column) * _WRAP + row) * 32 + np.int64(yaw)) * 8 + done
