"""How well feet stand on random blocks, and hands hold bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.locomotion.playing.composition import compose
from dynresp.locomotion.worlds.playground_fitting import (
    Grips,
    compose_on_playground,
    find_holds,
    grips,
)
from dynresp.locomotion.worlds.terrain import Terrain
from dynresp.locomotion.worlds.terrain_fitting import (
    Footing,
    compose_on_terrain,
    footing,
    walk_blocks,
)
from dynresp.locomotion.worlds.terrain_graph import TerrainGraph
from dynresp.locomotion.worlds.terrain_walk import (
    TerrainWalk,
    reach_on_terrain,
    start_on_terrain,
    wander_on_terrain,
)
from dynresp.motion.character import Character
from dynresp.motion.feet.skating import stance_slides
from dynresp.motion.motion import Motion
from studies.graphs.graph_study import of_graphs
from studies.study import Study, Target, Value

TERRAINS = 20
"""How many terrains are crossed, with seeds that follow each other."""
ON_BLOCK_M = 0.01
"""A stance is on its block if its height is right and it hangs over no edge to within this [m]."""

# Blocks along a side, and distance of start and goal to the corners [m].
_SIDE, _CORNER_M = 20, 1.2
_FPS = 60.0
_PLAYED_FPS, _PLAYED_S = 30.0, 120.0
_CM = 100.0


@dataclass(frozen=True, eq=False)
class Crossing:
    """A walk over a terrain.

    Attributes:
        terrain: The blocks.
        walk: The walk through the graph.
        motion: Its motion, feet fitted.
        feet: How its feet stand.
    """

    terrain: Terrain
    walk: TerrainWalk
    motion: Motion
    feet: Footing

    @property
    def on_block(self) -> int:
        """How many stances stand on their block, at its height and not over its edge."""
        within = (self.feet.off_height < ON_BLOCK_M) & (self.feet.overhang < ON_BLOCK_M)
        return int(np.count_nonzero(within))


def cross(graph: TerrainGraph, seed: int, wander_s: float | None = None) -> Crossing:
    """Walk over a terrain of 20 x 20 blocks that is drawn from a seed, from corner to corner.

    Args:
        graph: The graph to walk through.
        seed: Of the terrain.
        wander_s: Wander for this time instead [s].

    Raises:
        UsageError: Nobody can stand in the corner.
    """
    rng = np.random.default_rng(seed)
    terrain = Terrain.random(rng, _SIDE, _SIDE)
    goal = np.array(terrain.size) - _CORNER_M
    start = start_on_terrain(graph, terrain, [_CORNER_M, _CORNER_M], goal)
    rate = graph.graph.config.fps
    if wander_s is None:
        walk = reach_on_terrain(graph, terrain, start, goal)
    else:
        walk = wander_on_terrain(graph, terrain, start, round(wander_s * rate), rng)
    motion = compose_on_terrain(graph, terrain, walk, _FPS).motion
    blocks = walk_blocks(walk, rate, motion)
    return Crossing(terrain, walk, motion, footing(graph.character, terrain, motion, blocks))


def play(graph: MotionGraph, character: Character, seed: int) -> tuple[Grips, Grips, Motion]:
    """A random walk of two minutes through a playground.

    Args:
        graph: The graph.
        character: The character.
        seed: Of the random walk.

    Returns:
        How hands hold on before they are fitted, and after; and the fitted motion.
    """
    frames = round(_PLAYED_S * graph.config.fps)
    path = random_walk(graph, frames, np.random.default_rng(seed))
    played = compose(graph, character, path, fps=_PLAYED_FPS)
    fitted = compose_on_playground(graph, character, path, _PLAYED_FPS).motion
    holds = find_holds(graph, character, played)
    return grips(character, played.motion, holds), grips(character, fitted, holds), fitted


def _terrain(graph: MotionGraph, character: Character, count: int, seed: int) -> dict[str, Value]:
    terrain_graph = TerrainGraph(graph, character)
    crossed = [cross(terrain_graph, seed + k) for k in range(count)]
    wandered = [cross(terrain_graph, seed + k, wander_s=30.0) for k in range(max(1, count // 4))]
    found: dict[str, Value] = {"terrains": count}
    for name_of_walks, walks in (("crossing", crossed), ("wandering", wandered)):
        found |= {f"{name_of_walks}_{name}": value for name, value in _feet(walks).items()}
    found["crossing_slowest_search_s"] = max(each.walk.planning_s for each in crossed)
    return found


def _feet(crossings: Sequence[Crossing]) -> dict[str, Value]:
    """Figures of some walks over blocks."""
    slides = np.concatenate([each.feet.slide for each in crossings])
    sunk = np.concatenate([each.feet.sunk for each in crossings])
    return {
        "arrived": sum(each.walk.arrived for each in crossings),
        "stances": len(slides),
        "stances_on_their_block": sum(each.on_block for each in crossings),
        "stances_sliding_over_1_cm": int(np.count_nonzero(slides > 0.01)),
        "worst_slide_cm": _CM * float(slides.max()),
        "deepest_sole_cm": _CM * float(sunk.max()),
        "frames_with_a_sole_over_1_cm_deep": float((sunk > 0.01).mean()),
    }


def _playground(
    graph: MotionGraph, character: Character, count: int, seed: int
) -> Mapping[str, Value]:
    played = [play(graph, character, seed + k) for k in range(count)]
    skates = np.concatenate([stance_slides(motion, character) for _, _, motion in played])
    found: dict[str, Value] = {
        "seconds": count * _PLAYED_S,
        "holds": sum(len(before.slip) for before, _, _ in played),
    }
    held = {
        "blended": [before for before, _, _ in played],
        "fitted": [after for _, after, _ in played],
    }
    for stage, walks in held.items():
        slip = _CM * np.concatenate([each.slip for each in walks])
        off = _CM * np.concatenate([each.off_bar for each in walks])
        found |= {
            f"{stage}_slip_median_cm": float(np.median(slip)),
            f"{stage}_slip_p95_cm": float(np.percentile(slip, 95.0)),
            f"{stage}_slip_worst_cm": float(slip.max()),
            f"{stage}_hand_to_bar_axis_worst_cm": float(off.max()),
        }
    found["foot_slide_worst_cm"] = _CM * float(skates.max())
    return found


TERRAIN = Study(
    "terrain",
    "random terrains crossed from corner to corner, and a quarter of them wandered about on",
    "2 min",
    of_graphs(_terrain, ("terrain",), TERRAINS, 1),
    (
        Target("crossing_arrived", "all", at_least="terrains"),
        Target("crossing_stances_on_their_block", "all", at_least="crossing_stances"),
        Target("wandering_stances_on_their_block", "all", at_least="wandering_stances"),
    ),
    notes=(
        "A stance is on its block if it is within 1 cm of its height and hangs over an edge by at "
        "most 1 cm. A terrain is wandered about on for half a minute.",
    ),
)

PLAYGROUND = Study(
    "playground",
    "random walks of two minutes each through a playground, with hands on bars",
    "2 min",
    of_graphs(_playground, ("playground",), 5, 1),
    notes=("The slip of a hand is how far its stillest point comes away from where it holds.",),
)
