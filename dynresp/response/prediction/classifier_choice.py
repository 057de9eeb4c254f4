"""The choice of the classifier: a prediction, and the alignment of what was predicted."""

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

    The classes of reactions that the classifier takes to be best are aligned: one, or the best two
    or three, of which the one of least window error is taken. Where a class is a whole strategy,
    all its reactions are aligned.

    Whether the base motion is carried on is not guessed but measured, as the oracle does it: a
    graze is known from the simulation, and to see how well the base motion fits costs as much as
    to align one reaction. That halves the share of choices that are not the oracle's.
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
            best: How many of the predicted classes of reactions are aligned.
            reduced: Predict with the reduced model.
            alignment: Settings of the alignment.

        Raises:
            ClassifierError: The classifier was trained for something else.
            MotionError: A clip is shorter than a window.
        """
        classifier.check(TrainedFor.of(library, character))
        known = {CARRY_ON, *(reaction.name for reaction in library.reactions)}
        strange = sorted({name for own in classifier.members for name in own} - known)
        if strange:
            raise ClassifierError(
                f"the classifier predicts {strange[0]!r}, which the library {library.name!r} has "
                "not; train it anew"
            )
        self.character = character
        self.library = library
        self.config = config
        self.classifier = classifier
        self._best = best
        # One more is asked for: to carry on may be among them.
        self._asked = min(best + 1, len(classifier.classes))
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
        ranked = self.classifier.rank(features, self._asked, reduced=self._reduced)
        fits = align_base_motions(self.character, self.config, hits)
        return [
            self._choose(hits, row, self._reactions(ranked[row]), fit)
            for row, fit in enumerate(fits)
        ]

    def _reactions(self, ranked: npt.NDArray[np.int64]) -> list[str]:
        """The members of the best classes but that to carry on."""
        members = [self.classifier.members[place] for place in ranked]
        classes = [own for own in members if CARRY_ON not in own][: self._best]
        return [name for own in classes for name in own]

    def _choose(self, hits: LookAhead, row: int, names: list[str], stay: BaseMotionFit) -> Choice:
        """To carry on, or the best of what was predicted."""
        errors = {CARRY_ON: stay.error}
        carry_on = Choice(CARRY_ON, hits.bases[row], stay.exit, stay.entry, stay.error, errors)
        if hits.grazes[row] or not names:
            return carry_on
        trace = hits.states.centers[row], hits.states.quaternions[row]
        aligned = self._aligner.align(*trace, names)
        errors |= {alignment.reaction: alignment.error for alignment in aligned}
        best = min(aligned, key=lambda alignment: alignment.error)
        if stay.error <= min(best.error, self.config.carry_on_max_error):
            return carry_on
        return self._enter(self._aligner.snap(*trace, best), errors)

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
