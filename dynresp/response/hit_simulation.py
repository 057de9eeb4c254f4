"""Prepares hits for the simulation, those of one kind together."""

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
    """Hits of one kind, ready to be simulated in one scene.

    Attributes:
        rows: Their indices among the hits that were given.
        bases: Their base motions.
        prepared: Their impacts as the simulation needs them.
        simulation: Simulates them; not started yet.
    """

    rows: list[int]
    bases: list[Motion]
    prepared: list[PreparedImpact]
    simulation: Simulation


class HitStage:
    """Prepares hits on one character; each kind of scene is compiled once.

    Attributes:
        character: The character.
        config: Settings of the response.
        threads: Threads for the simulation, 0 for all cores.
    """

    def __init__(self, character: Character, config: ResponseConfig, threads: int = 0) -> None:
        """Compile nothing yet; scenes are compiled when they are first used."""
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
        """Prepare hits, one batch for each kind of impact.

        Args:
            hits: Pairs of a base motion (at the simulation's frame rate) and an impact.

        Raises:
            SpecError: An impact comes before the start or after the end of its base motion.
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
    """Velocity (45,) of a motion at a frame: a central difference, one-sided at the ends."""
    first = max(frame - 1, 0)
    return pose_velocities(motion.poses[first : frame + 2], motion.fps)[frame - first]
