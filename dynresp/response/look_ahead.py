"""Look-ahead: simulations of many hits from contact on, as arrays from which a choice is made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import BodyStates, Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.physics.prepared_impact import PreparedImpact
from dynresp.physics.trace import Trace
from dynresp.response.response import GRAZE_S, ResponseConfig


@dataclass(frozen=True)
class LookAhead:
    """Hits that were simulated for equally long after contact.

    Attributes:
        rows: (hits,) indices of the traces: those that have a contact and did not diverge.
        bases: The base motion of each hit.
        contacts: (hits,) first frame at or after contact, counted in the base motion.
        poses: (hits, frames, 59) from that frame on.
        velocities: (hits, frames, 45) likewise, rows of `qvel`.
        states: Body states, arrays (hits, frames, bodies, ...).
        speed_changes: (hits,) change of the centre of mass's speed over the ground [m/s]: the
            simulation's mean velocity minus the base motion's, over 0.1 s from contact on; for a
            longer push, over the last 0.1 s of it that the search can see.
        grazes: (hits,) whether that change is so small that there is no reaction (carry on).
    """

    rows: npt.NDArray[np.intp]
    bases: tuple[Motion, ...]
    contacts: npt.NDArray[np.intp]
    poses: FloatArray
    velocities: FloatArray
    states: BodyStates
    speed_changes: FloatArray
    grazes: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        """Number of hits."""
        return len(self.rows)

    def states_of(self, hit: int) -> BodyStates:
        """Body states (frames, bodies, ...) of one hit."""
        states = self.states
        return BodyStates(states.positions[hit], states.quaternions[hit], states.centers[hit])


def look_ahead_of(
    character: Character,
    config: ResponseConfig,
    bases: Sequence[Motion],
    prepared: Sequence[PreparedImpact],
    traces: Sequence[Trace],
) -> LookAhead:
    """Collect the hits that have a contact and did not diverge.

    Args:
        character: The character.
        config: Says what a graze is.
        bases: Base motion of each hit.
        prepared: Its impact.
        traces: Its simulation, all equally long after contact.

    Returns:
        Those hits; each has the bits that it would have alone.
    """
    rows = [
        row
        for row, trace in enumerate(traces)
        if trace.contact is not None and trace.diverged is None
    ]
    hit_traces = [traces[row] for row in rows]
    firsts = [trace.contact.frame for trace in hit_traces if trace.contact is not None]
    hit_bases = tuple(bases[row] for row in rows)
    contacts = np.array(
        [prepared[row].start + first for row, first in zip(rows, firsts, strict=True)], np.intp
    )
    pushes = np.array([prepared[row].push_duration_s for row in rows])
    frames = min((len(t.poses) - f for t, f in zip(hit_traces, firsts, strict=True)), default=1)
    poses = np.zeros((len(rows), frames, 59))
    velocities = np.zeros((len(rows), frames, 45))
    for k, (trace, first) in enumerate(zip(hit_traces, firsts, strict=True)):
        poses[k] = trace.poses[first : first + frames]
        velocities[k] = trace.velocities[first : first + frames]
    states = kinematics_of_many(character, poses)
    changes = _speed_changes(character, config, hit_bases, contacts, pushes, states)
    return LookAhead(
        rows=np.array(rows, np.intp),
        bases=hit_bases,
        contacts=contacts,
        poses=poses,
        velocities=velocities,
        states=states,
        speed_changes=changes,
        grazes=changes < config.graze_speed,
    )


def kinematics_of_many(character: Character, poses: FloatArray) -> BodyStates:
    """Body states (hits, frames, bodies, ...) of poses (hits, frames, 59)."""
    flat = character.kinematics(poses.reshape(-1, poses.shape[-1]))
    shape = poses.shape[:2]
    return BodyStates(
        flat.positions.reshape(*shape, *flat.positions.shape[1:]),
        flat.quaternions.reshape(*shape, *flat.quaternions.shape[1:]),
        flat.centers.reshape(*shape, *flat.centers.shape[1:]),
    )


def base_poses(bases: Sequence[Motion], frames: npt.NDArray[np.intp]) -> FloatArray:
    """Poses (hits, n, 59) of base motions at frames (hits, n); beyond an end, its pose holds."""
    return np.stack(
        [base.poses[np.clip(at, 0, len(base) - 1)] for base, at in zip(bases, frames, strict=True)]
    )


def _speed_changes(
    character: Character,
    config: ResponseConfig,
    bases: tuple[Motion, ...],
    contacts: npt.NDArray[np.intp],
    pushes_s: FloatArray,
    states: BodyStates,
) -> FloatArray:
    """Changes of the speed of the centre of mass over the ground (hits,) [m/s]."""
    if not len(bases):
        return np.zeros(0)
    fps = config.physics.fps
    frames = max(1, round(GRAZE_S * fps))
    seen = np.round(np.minimum(pushes_s, config.window.exit_max_s) * fps).astype(np.intp)
    last = np.maximum(frames, seen)
    span = np.stack([last - frames, last], axis=1)
    planned = kinematics_of_many(character, base_poses(bases, contacts[:, None] + span)).centers
    centers = states.centers[np.arange(len(bases))[:, None], span]
    moved = (centers[:, 1] - centers[:, 0]) - (planned[:, 1] - planned[:, 0])
    share = (character.masses / character.masses.sum())[:, None]
    change = np.sum(share * moved, axis=1)
    return np.asarray(np.hypot(change[:, 0], change[:, 1]) * fps / frames)
