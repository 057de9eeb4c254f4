"""A walk by chance, in whatever world the graph belongs to."""

from __future__ import annotations

import numpy as np

from dynresp.avatar_runs.avatar_run import AvatarRun
from dynresp.avatar_runs.terrain_run import terrain_run
from dynresp.avatar_runs.world_setup import TERRAIN, play_in_world
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import random_walk
from dynresp.motion.character import Character


def chance_run(
    graph: MotionGraph,
    character: Character,
    seconds: float = 20.0,
    seed: int = 0,
    fps: float = 30.0,
) -> AvatarRun:
    """Walk by the graph's probabilities; `dynresp graph walk` does this.

    With a graph of rough terrain the avatar wanders over a terrain that is drawn from the seed.

    Args:
        graph: The motion graph.
        character: The avatar's body.
        seconds: How long it walks [s].
        seed: Seed of the walk, and of the terrain.
        fps: Frame rate of the motion [1/s].

    Raises:
        DynrespError: No step leads on over the terrain.

    Example:
        >>> import dynresp
        >>> from dynresp.motion.character import default_character
        >>> graph = dynresp.build_graph("builtin")
        >>> run = chance_run(graph, default_character(), seconds=5.0, seed=3)
        >>> run.motion.duration
        5.0
        >>> content = run.save("walk", video=False)
    """
    if graph.database.world == TERRAIN:
        return terrain_run(graph, character, seconds=seconds, seed=seed, fps=fps)
    count = max(2, round(seconds * graph.config.fps) + 1)
    frames = random_walk(graph, count, np.random.default_rng(seed))
    composition = play_in_world(graph, character, frames, fps)
    return AvatarRun.of(
        composition,
        graph,
        character,
        title="A walk by chance",
        subtitle=f"{composition.motion.duration:.0f} s, {len(composition.jumps)} jumps, "
        f"seed {seed}",
        about={"seed": seed},
    )
