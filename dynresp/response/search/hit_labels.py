"""Label hits for training a classifier: their features, and what the full search chose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.physics.impacts import Impact
from dynresp.physics.trace import Trace
from dynresp.response.hit_simulation import HitBatch, HitStage
from dynresp.response.look_ahead import look_ahead_of
from dynresp.response.prediction.hit_features import FEATURE_NAMES, extract
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.response.search.full_search_choice import FullSearchChooser, choice_columns

OUTCOMES = ("hit", "miss", "diverged")
"""Outcome of a hit: contact, no contact, or a simulation that diverged."""


@dataclass(frozen=True)
class HitLabels:
    """Labels of n hits. Where nothing was hit, numbers are NaN and indices -1.

    Attributes:
        outcome: (n,) index into `OUTCOMES`.
        contact_time_s: (n,) from the base motion's start [s].
        contact_frame: (n,) first frame at or after contact, in the base motion.
        contact_body: (n,) index of the body hit.
        contact_force: (n,) in the step of contact; of a push, its peak [N].
        contact_point: (n, 3) world [m].
        features: (n, features), see `hit_features.FEATURE_NAMES`.
        label: (n,) class that the full search chose: index of a reaction in the library, or after
            the last of them carry on.
        graze: (n,) whether the hit was too light for a reaction.
        speed_change: (n,) of the centre of mass over the ground [m/s].
        errors: (n, classes) least mismatch (window error) of each class [m].
        exit_frames: (n, classes) its exit, frames after contact.
        entry_frames: (n, classes) its entry: frame of the reaction's clip, or of the base motion
            after contact.
    """

    outcome: npt.NDArray[np.int8]
    contact_time_s: npt.NDArray[np.float64]
    contact_frame: npt.NDArray[np.int32]
    contact_body: npt.NDArray[np.int8]
    contact_force: npt.NDArray[np.float32]
    contact_point: npt.NDArray[np.float32]
    features: npt.NDArray[np.float32]
    label: npt.NDArray[np.int16]
    graze: npt.NDArray[np.bool_]
    speed_change: npt.NDArray[np.float32]
    errors: npt.NDArray[np.float32]
    exit_frames: npt.NDArray[np.int16]
    entry_frames: npt.NDArray[np.int16]


class HitLabeller:
    """Simulates hits and lets the full search choose.

    Attributes:
        classes: Names of the reactions in the order of the library, then `CARRY_ON`.
        feature_names: Names of the features.
    """

    def __init__(
        self,
        character: Character,
        library: ReactionLibrary,
        config: ResponseConfig,
        threads: int = 1,
    ) -> None:
        """Cut the library's windows once.

        Args:
            character: The character.
            library: Its reactions, at the simulation's frame rate.
            config: Settings.
            threads: Threads of the simulation, 0 for all cores.

        Raises:
            MotionError: A clip of the library is shorter than a window.
        """
        self.character = character
        self.config = config
        self.classes = (*(reaction.name for reaction in library.reactions), CARRY_ON)
        self.feature_names = FEATURE_NAMES
        self._stage = HitStage(character, config, threads)
        self._chooser = FullSearchChooser(character, library, config)

    def label(self, hits: Sequence[tuple[Motion, Impact]]) -> HitLabels:
        """Label hits; each is bitwise what it would be alone.

        Args:
            hits: Base motions (at the simulation's frame rate) and what hits them.

        Raises:
            SpecError: An impact is outside its base motion.
            MotionError: A base motion has another frame rate.
        """
        labels = self._empty(len(hits))
        for batch in self._stage.batches(hits):
            traces = batch.simulation.look_ahead(self.config.horizon_s)
            for row, prepared, trace in zip(batch.rows, batch.prepared, traces, strict=True):
                self._write_contact(labels, row, prepared.start, trace)
            self._write_choices(labels, batch, traces)
        return labels

    def _write_contact(self, labels: HitLabels, row: int, start: int, trace: Trace) -> None:
        if trace.diverged is not None:
            labels.outcome[row] = OUTCOMES.index("diverged")
        contact = trace.contact
        if contact is None:
            return
        if trace.diverged is None:
            labels.outcome[row] = OUTCOMES.index("hit")
        labels.contact_time_s[row] = start / self.config.physics.fps + contact.time_s
        labels.contact_frame[row] = start + contact.frame
        labels.contact_body[row] = self.character.body(contact.body)
        labels.contact_force[row] = contact.force
        labels.contact_point[row] = contact.point

    def _write_choices(self, labels: HitLabels, batch: HitBatch, traces: Sequence[Trace]) -> None:
        seen = look_ahead_of(self.character, self.config, batch.bases, batch.prepared, traces)
        if not len(seen):
            return
        rows = np.array(batch.rows)[seen.rows]
        fps = self.config.physics.fps
        labels.features[rows] = extract(self.character, seen.poses, seen.velocities, fps)
        labels.graze[rows] = seen.grazes
        labels.speed_change[rows] = seen.speed_changes
        errors, exits, entries, chosen = choice_columns(self._chooser.answers(seen))
        entries[:, -1] -= seen.contacts
        labels.errors[rows] = errors
        labels.exit_frames[rows] = exits
        labels.entry_frames[rows] = entries
        labels.label[rows] = chosen

    def _empty(self, count: int) -> HitLabels:
        """Labels of hits that all missed."""
        classes = len(self.classes)
        return HitLabels(
            outcome=np.full(count, OUTCOMES.index("miss"), np.int8),
            contact_time_s=np.full(count, np.nan),
            contact_frame=np.full(count, -1, np.int32),
            contact_body=np.full(count, -1, np.int8),
            contact_force=np.full(count, np.nan, np.float32),
            contact_point=np.full((count, 3), np.nan, np.float32),
            features=np.full((count, len(FEATURE_NAMES)), np.nan, np.float32),
            label=np.full(count, -1, np.int16),
            graze=np.zeros(count, np.bool_),
            speed_change=np.full(count, np.nan, np.float32),
            errors=np.full((count, classes), np.nan, np.float32),
            exit_frames=np.full((count, classes), -1, np.int16),
            entry_frames=np.full((count, classes), -1, np.int16),
        )
