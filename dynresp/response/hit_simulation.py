"""Hits made ready and simulated until the choice can be made, those of one kind together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion, pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Impact
from dynresp.physics.prepared_impact import PreparedImpact, prepare
from dynresp.physics.scene import ImpactorKind, Scene
from dynresp.physics.simulation import Simulation
from dynresp.physics.trace import Setup
from dynresp.response.response import ResponseConfig
from dynresp.support.errors import MotionError


@dataclass(frozen=True)
class HitBatch:
    """Hits that need the same scene, about to be simulated.

    Attributes:
        rows: Which of the hits asked for they are.
        bases: Their base motions.
        prepared: Their impacts in terms of the simulation.
        simulation: Where they are simulated.
    """

    rows: list[int]
    bases: list[Motion]
    prepared: list[PreparedImpact]
    simulation: Simulation


class HitStage:
    """Makes hits on one character ready; its scenes are compiled once.

    Attributes:
        character: The character.
        config: Settings.
        threads: Threads for the physics, 0 for all cores.
    """

    def __init__(self, character: Character, config: ResponseConfig, threads: int = 0) -> None:
        """Nothing is compiled before it is needed."""
        self.character = character
        self.config = config
        self.threads = threads
        self._scenes: dict[ImpactorKind, Scene] = {}

    def scene(self, kind: ImpactorKind) -> Scene:
        """The scene for a kind of impact."""
        if kind not in self._scenes:
            self._scenes[kind] = Scene(self.character, kind, self.config.physics)
        return self._scenes[kind]

    def batches(self, hits: Sequence[tuple[Motion, Impact]]) -> Iterator[HitBatch]:
        """Make hits ready, kind by kind.

        Args:
            hits: Base motions (at the simulation's frame rate) and what hits them.

        Raises:
            SpecError: An impact lies outside its base motion.
            MotionError: A base motion has another frame rate.
        """
        physics = self.config.physics
        for base, _ in hits:
            if base.fps != physics.fps:
                raise MotionError(
                    f"base motion {base.name!r} has {base.fps:g} fps, but the simulation runs at "
                    f"{physics.fps:g}; resample it"
                )
        prepared = [prepare(impact, base, self.character, physics) for base, impact in hits]
        for kind in ImpactorKind:
            rows = [row for row, impact in enumerate(prepared) if impact.kind is kind]
            if rows:
                bases = [hits[row][0] for row in rows]
                own = [prepared[row] for row in rows]
                setups = [
                    Setup(base.poses[p.start :], p, velocity=velocity_at(base, p.start))
                    for base, p in zip(bases, own, strict=True)
                ]
                simulation = Simulation(self.scene(kind), setups, self.threads)
                yield HitBatch(rows, bases, own, simulation)


def velocity_at(motion: Motion, frame: int) -> FloatArray:
    """A motion's velocity (45,) at a frame, by the central difference where there is one."""
    first = max(frame - 1, 0)
    return pose_velocities(motion.poses[first : frame + 2], motion.fps)[frame - first]
