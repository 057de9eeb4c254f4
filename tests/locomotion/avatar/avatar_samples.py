"""Avatars that are watched while they walk and are hit."""

import numpy as np

from dynresp.locomotion.avatar.avatar import Activity, RandomPlanner
from dynresp.locomotion.avatar.avatar_crowd import AvatarCrowd
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import ROOT, Character
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.motion.rotations import FloatArray
from dynresp.response.runtime.dynamic_responder import Phase


class Watched:
    """A crowd of avatars, with all that it has shown."""

    def __init__(
        self,
        character: Character,
        library: ReactionLibrary,
        graph: MotionGraph,
        seeds: list[int],
        threads: int = 1,
    ) -> None:
        generators = [np.random.default_rng(seed) for seed in seeds]
        starts = [
            (int(rng.choice(graph.frames)), np.array([1.0, 2.0, 0.0, rng.uniform(-3.0, 3.0)]))
            for rng in generators
        ]
        planners = [RandomPlanner(graph, rng) for rng in generators]
        self.crowd = AvatarCrowd(character, library, graph, planners, starts, threads=threads)
        self.avatars = self.crowd.avatars
        self._shown = [np.stack([avatar.responder.pose for avatar in self.avatars])]
        self._activities = [[avatar.activity for avatar in self.avatars]]

    def go_on(self, frames: int) -> None:
        for _ in range(frames):
            self._shown.append(self.crowd.advance())
            self._activities.append([avatar.activity for avatar in self.avatars])

    def until(self, phase: Phase, most: int = 120) -> None:
        for _ in range(most):
            if self.avatars[0].responder.phase is phase:
                return
            self.go_on(1)
        raise AssertionError(f"never {phase}")

    def shown(self, i: int = 0) -> FloatArray:
        return np.stack([poses[i] for poses in self._shown])

    def activity(self, i: int = 0) -> list[Activity]:
        return [now[i] for now in self._activities]


def root_steps(poses: FloatArray) -> FloatArray:
    """How far the root goes from each frame to the next [m]."""
    return np.asarray(np.linalg.norm(np.diff(poses[:, ROOT], axis=0), axis=1))
