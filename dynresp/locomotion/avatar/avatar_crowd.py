"""Several avatars that walk by one graph and are advanced together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from dynresp.locomotion.avatar.avatar import Avatar, Planner, RandomPlanner
from dynresp.locomotion.avatar.graph_entry import ReentryPlanner
from dynresp.locomotion.graph import placement
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.random_walk import check_in_component
from dynresp.motion.character import Character, default_character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.motion.rotations import FloatArray
from dynresp.response.choice import Chooser
from dynresp.response.response import ResponseConfig
from dynresp.response.runtime.crowd import Crowd
from dynresp.support.errors import UsageError


class AvatarCrowd:
    """Avatars that walk by one graph and are advanced together; their hits are simulated together.

    Attributes:
        graph: The graph by which they walk.
        avatars: The avatars.
        crowd: Their responders.
    """

    def __init__(
        self,
        character: Character,
        library: ReactionLibrary,
        graph: MotionGraph,
        planners: Sequence[Planner],
        starts: Sequence[tuple[int, npt.ArrayLike]],
        response: ResponseConfig | None = None,
        chooser: Chooser | None = None,
        threads: int = 0,
        reentry: ReentryPlanner | None = None,
    ) -> None:
        """Create the avatars.

        Args:
            character: The body of all avatars.
            library: Its reactions, at the simulation's frame rate.
            graph: The graph by which they walk, of the same character, with a frame rate of at
                most the simulation's.
            planners: Decide where each goes.
            starts: For each a frame of the graph and the placement (4,) of its clip; see
                `dynresp.locomotion.graph.placement`.
            response: Settings of their responders.
            chooser: Chooses reactions; None for the full search.
            threads: Threads for the physics, 0 for all cores.
            reentry: Finds how they return to the graph. Pass one to share it among crowds of one
                graph; None makes one.

        Raises:
            UsageError: The graph belongs to another character or has too high a frame rate, a start
                is not in it, or the numbers of planners and starts differ.
            MotionError: There is no avatar, or the library has another frame rate.
        """
        settings = response or ResponseConfig()
        fps = settings.physics.fps
        if graph.database.character != character.identity:
            raise UsageError("the graph was made of another character's motions; build it again")
        if graph.database.fps > fps:
            raise UsageError(
                f"the graph has {graph.database.fps:g} fps, the simulation {fps:g}; build the "
                "graph with as many or fewer"
            )
        if len(planners) != len(starts):
            raise UsageError(
                f"{len(starts)} starts and {len(planners)} planners were given; "
                "give one of each for every avatar"
            )
        for frame, _ in starts:
            check_in_component(graph, frame)
        self.graph = graph
        bases = [
            Motion(placement.place_poses(graph.database.poses[f : f + 1], place), fps, "start")
            for f, place in starts
        ]
        self.crowd = Crowd(character, library, bases, settings, chooser, threads)
        reentry = reentry or ReentryPlanner(graph, character)
        self.avatars = tuple(
            Avatar(character, responder, planner, reentry, frame)
            for responder, planner, (frame, _) in zip(
                self.crowd.responders, planners, starts, strict=True
            )
        )

    @classmethod
    def wandering(
        cls, graph: MotionGraph, library: ReactionLibrary, count: int = 1, seed: int = 0
    ) -> AvatarCrowd:
        """Avatars that start at random frames, at the origin, and walk at random.

        Args:
            graph: The graph by which they walk, of the product's own character.
            library: Its reactions, at 30 frames a second.
            count: Number of avatars.
            seed: Seed of their starts and walks.

        Raises:
            UsageError: The graph was made of another character's motions.
            MotionError: There is no avatar, or the library has another frame rate.
        """
        rng = np.random.default_rng(seed)
        starts = [(int(rng.choice(graph.frames)), placement.IDENTITY) for _ in range(count)]
        planners = [
            RandomPlanner(graph, np.random.default_rng([seed, k + 1])) for k in range(count)
        ]
        return cls(default_character(), library, graph, planners, starts)

    def advance(self) -> FloatArray:
        """Advance by one frame.

        Returns:
            (avatars, 59) their poses.
        """
        for avatar in self.avatars:
            avatar.plan_ahead()
        return self.crowd.advance()
