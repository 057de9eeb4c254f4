"""Random walks through a motion graph, by its probabilities (eq. 1)."""

from __future__ import annotations

import numpy as np

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.support.arrays import IntArray
from dynresp.support.errors import UsageError


def random_walk(
    graph: MotionGraph, frames: int, rng: np.random.Generator, start: int | None = None
) -> IntArray:
    """Draw a walk by the graph's probabilities.

    Args:
        graph: The graph.
        frames: Number of frames.
        rng: Random generator.
        start: The frame before the first, in the graph's component. By default the walk begins
            with a random frame.

    Returns:
        (frames,) frames of the walk. `start` is not part of it.

    Raises:
        UsageError: The start is not in the component, or `frames` is below 1.
    """
    from dynresp.locomotion.graph.random_walk_kernel import walk_kernel

    if frames < 1:
        raise UsageError(f"a walk needs at least 1 frame, got {frames}")
    if start is not None:
        check_in_component(graph, start)
    begin = int(rng.choice(graph.frames)) if start is None else start
    path = np.empty(frames + 1, dtype=np.int32)
    path[0] = begin
    walk_kernel(graph.offsets, graph.targets, graph.cumulative, rng.random(frames), path)
    return path[:-1] if start is None else path[1:]


def check_in_component(graph: MotionGraph, frame: int) -> None:
    """Check that walks can use a frame.

    Raises:
        UsageError: It is not in the component.
    """
    if not 0 <= frame < len(graph.database) or graph.offsets[frame] == graph.offsets[frame + 1]:
        raise UsageError(
            f"frame {frame} is not in the graph's component of {len(graph.frames)} frames; "
            f"the nearest that is: {_nearest(graph, frame)}"
        )


def _nearest(graph: MotionGraph, frame: int) -> int:
    return int(graph.frames[np.argmin(np.abs(graph.frames.astype(np.int64) - frame))])
