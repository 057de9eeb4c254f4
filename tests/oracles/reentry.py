"""The way back into a graph, slow and readable: every moment and frame compared one by one."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.rotations import FloatArray
from tests.oracles.motion_graph import distance


@dataclass(frozen=True)
class Costs:
    """Limit and costs of an entry; see `graph_entry`."""

    max_distance: float
    waiting: float
    other_feet: float


@dataclass(frozen=True)
class Found:
    """A frame that resembles a pose most."""

    frame: int
    distance: float
    same_contacts: bool


def nearest(
    graph: MotionGraph,
    joints: tuple[str, ...],
    frames: list[int],
    pose: FloatArray,
    velocity: FloatArray,
    feet: npt.NDArray[np.bool_],
    max_distance: float,
) -> Found:
    """The frame that resembles a pose most; with the same feet standing, if one is near enough."""
    database = graph.database
    best = {True: Found(-1, np.inf, True), False: Found(-1, np.inf, False)}
    for frame in frames:
        recorded = database.poses[frame], database.velocities[frame]
        d = distance((pose, velocity), recorded, joints, graph.config)
        same = bool((database.contacts[frame, :2] == feet).all())
        for kind in (same, False):
            if d < best[kind].distance:
                best[kind] = Found(frame, d, kind)
    return best[True] if best[True].distance <= max_distance else best[False]


def left_at(found: list[Found], times: FloatArray, costs: Costs) -> int | None:
    """The moment at which a motion is left for the graph; None where it ends out of reach."""
    best, least = None, np.inf
    for moment, (it, time) in enumerate(zip(found, times, strict=True)):
        if it.distance > costs.max_distance:
            best, least = None, np.inf
            continue
        cost = it.distance + costs.waiting * time
        if not it.same_contacts:
            cost += costs.other_feet
        if cost < least:
            best, least = moment, cost
    return best
