"""`ClassifierChooser`: predicts the best reactions, and aligns only these."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.response.alignment.alignment import Aligner, AlignmentConfig
from dynresp.response.alignment.alignment_result import Alignment
from dynresp.response.choice import Choice
from dynresp.response.look_ahead import LookAhead
from dynresp.response.prediction.classifier import Classifier, ClassifierError, TrainedFor
from dynresp.response.prediction.hit_features import extract
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.response.search.carry_on import BaseMotionFit, align_base_motions
from dynresp.response.search.full_search_choice import reaction_tracks


class ClassifierChooser:
    """Chooses by prediction and sparse alignment (Zordan et al. 2007, sections 4 and 5).

    The best one, two or three classes are aligned, and the reaction of least mismatch (window
    error) is chosen. If a class is a whole strategy, all its reactions are aligned.

    No reaction (carry on) is not predicted but measured, as in the full search (oracle): a graze is
    known from the simulation, and the fit of the base motion costs as much as one alignment. This
    halves the share of choices that differ from the full search.
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
        """Check the classifier and prepare the library.

        Args:
            character: The character.
            library: Its reactions.
            config: Settings of the response.
            classifier: A classifier trained for this character and library.
            best: How many of the predicted classes are aligned.
            reduced: Whether to predict with the reduced model.
            alignment: Settings of the alignment; None for the defaults.

        Raises:
            ClassifierError: The classifier was trained for something else.
            MotionError: A clip is shorter than a window.
        """
        classifier.check(TrainedFor.of(library, character))
        known = {CARRY_ON, *(reaction.name for reaction in library.reactions)}
        unknown = sorted({name for choices in classifier.members for name in choices} - known)
        if unknown:
            raise ClassifierError(
                f"the classifier predicts {unknown[0]!r}, which the library {library.name!r} does "
                "not have; train it again with `dynresp train`"
            )
        self.character = character
        self.library = library
        self.config = config
        self.classifier = classifier
        self._best = best
        # One more class than is aligned, because `carry_on` may be among them.
        self._ranked = min(best + 1, len(classifier.classes))
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
        ranked = self.classifier.rank(features, self._ranked, reduced=self._reduced)
        fits = align_base_motions(self.character, self.config, hits)
        return [
            self._choose(hits, row, self._reactions(ranked[row]), fit)
            for row, fit in enumerate(fits)
        ]

    def _reactions(self, ranked: npt.NDArray[np.int64]) -> list[str]:
        """The reactions of the best classes, without `carry_on`."""
        members = [self.classifier.members[c] for c in ranked]
        reactions = [names for names in members if CARRY_ON not in names][: self._best]
        return [name for names in reactions for name in names]

    def _choose(
        self, hits: LookAhead, row: int, names: list[str], base_fit: BaseMotionFit
    ) -> Choice:
        """Choose the best predicted reaction, or no reaction (carry on)."""
        errors = {CARRY_ON: base_fit.error}
        carry_on = Choice(
            CARRY_ON, hits.bases[row], base_fit.exit, base_fit.entry, base_fit.error, errors
        )
        if hits.grazes[row] or not names:
            return carry_on
        trace = hits.states.centers[row], hits.states.quaternions[row]
        aligned = self._aligner.align(*trace, names)
        errors |= {alignment.reaction: alignment.error for alignment in aligned}
        best = min(aligned, key=lambda alignment: alignment.error)
        if base_fit.error <= min(best.error, self.config.carry_on_max_error):
            return carry_on
        return self._enter(self._aligner.snap(*trace, best), errors)

    def _enter(self, alignment: Alignment, errors: dict[str, float]) -> Choice:
        """The choice of a reaction; if it is entered between two frames, its clip is resampled."""
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
