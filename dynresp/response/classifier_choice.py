"""The choice of the classifier: a prediction, and the alignment of what was predicted."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dynresp.motion.character import Character
from dynresp.motion.library import ReactionLibrary
from dynresp.motion.motion import Motion
from dynresp.response.alignment import Aligner, AlignmentConfig
from dynresp.response.alignment_result import Alignment
from dynresp.response.carry_on import search_base_motions
from dynresp.response.choice import Choice
from dynresp.response.classifier import Classifier, TrainedFor
from dynresp.response.features import extract
from dynresp.response.look_ahead import LookAhead
from dynresp.response.oracle import OracleResult
from dynresp.response.oracle_choice import reaction_tracks
from dynresp.response.response import CARRY_ON, ResponseConfig


class ClassifierChooser:
    """Chooses by prediction and sparse alignment (Zordan et al. 2007, sections 4 and 5).

    A graze is carried on through; that is known from the simulation. Of other hits the classes
    that the classifier takes to be best are aligned: one, or the best two or three, of which the
    one of least window error is taken. Where a class is a whole strategy, all its reactions are
    aligned.
    """

    def __init__(
        self,
        character: Character,
        library: ReactionLibrary,
        config: ResponseConfig,
        classifier: Classifier,
        *,
        best: int = 1,
        reduced: bool = False,
        alignment: AlignmentConfig | None = None,
    ) -> None:
        """Lay the library out once.

        Args:
            character: The character.
            library: Its reactions.
            config: Settings.
            classifier: Trained for this character and library.
            best: How many of the predicted classes are aligned.
            reduced: Predict with the reduced model.
            alignment: Settings of the alignment.

        Raises:
            ClassifierError: The classifier was trained for something else.
            MotionError: A clip is shorter than a window.
        """
        classifier.check(TrainedFor.of(library, character))
        self.character = character
        self.library = library
        self.config = config
        self.classifier = classifier
        self._best = min(best, len(classifier.classes))
        self._reduced = reduced
        self._aligner = Aligner(
            reaction_tracks(character, library, config), config.window, alignment
        )

    def choose(self, hits: LookAhead) -> list[Choice]:
        """Choose for each hit; each is bitwise what it would be alone."""
        if not len(hits):
            return []
        fps = self.config.physics.fps
        features = extract(self.character, hits.poses, hits.velocities, fps)
        ranked = self.classifier.rank(features, self._best, reduced=self._reduced)
        candidates = [
            [CARRY_ON] if graze else [n for place in row for n in self.classifier.members[place]]
            for row, graze in zip(ranked, hits.grazes, strict=True)
        ]
        staying = [row for row, names in enumerate(candidates) if CARRY_ON in names]
        found = search_base_motions(self.character, self.config, hits, staying)
        stays = {
            row: self._carry_on(hits.bases[row], *fit)
            for row, fit in zip(staying, found, strict=True)
        }
        return [
            self._choose(hits, row, names, stays.get(row)) for row, names in enumerate(candidates)
        ]

    def _choose(self, hits: LookAhead, row: int, names: list[str], stay: Choice | None) -> Choice:
        """The best of what was predicted."""
        trace = hits.states.centers[row], hits.states.quaternions[row]
        reactions = [name for name in names if name != CARRY_ON]
        aligned = self._aligner.align(*trace, reactions) if reactions else []
        errors = {alignment.reaction: alignment.error for alignment in aligned}
        if stay is not None:
            errors[CARRY_ON] = stay.error
            others = min((alignment.error for alignment in aligned), default=math.inf)
            if not aligned or stay.error <= min(others, self.config.carry_on_max_error):
                return replace(stay, errors=errors)
        best = min(aligned, key=lambda alignment: alignment.error)
        return self._enter(self._aligner.snap(*trace, best), errors)

    def _carry_on(self, base: Motion, found: OracleResult, entry: int) -> Choice:
        stay = found.best
        return Choice(CARRY_ON, base, stay.exit_frame, entry, stay.error, {})

    def _enter(self, alignment: Alignment, errors: dict[str, float]) -> Choice:
        """A reaction entered between two of its frames: its clip read that much later."""
        motion = self.library.reaction(alignment.reaction).motion
        entry = math.floor(alignment.entry_frame)
        offset = alignment.entry_frame - entry
        if offset:
            times = (np.arange(len(motion) - 1) + offset) / motion.fps
            motion = Motion(motion.sample(times), motion.fps, motion.name, motion.contacts[:-1])
        return Choice(
            name=alignment.reaction,
            motion=motion,
            exit=round(alignment.exit_frame),
            entry=entry,
            error=alignment.error,
            errors=errors,
            offset=offset,
        )
