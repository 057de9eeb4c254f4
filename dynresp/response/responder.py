"""Respond to hits: simulate, choose and align a reaction, blend, and put the motion together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from dynresp.motion.character import Character
from dynresp.motion.ground import foot_contacts
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Impact
from dynresp.physics.prepared_impact import PreparedImpact
from dynresp.physics.trace import Trace
from dynresp.response.choice import Choice, Chooser
from dynresp.response.hit_simulation import HitBatch, HitStage
from dynresp.response.look_ahead import look_ahead_of
from dynresp.response.response import Response, ResponseConfig
from dynresp.response.search.full_search_choice import FullSearchChooser
from dynresp.response.transition.choice_to_motion import (
    blend_into_choice,
    simulate_to_blend_end,
)
from dynresp.support.errors import MotionError


class Responder:
    """Makes responses to hits on one character, with one reaction library."""

    def __init__(
        self,
        character: Character,
        library: ReactionLibrary,
        config: ResponseConfig | None = None,
        threads: int = 0,
        chooser: Chooser | None = None,
    ) -> None:
        """Prepare the simulation and the chooser.

        Args:
            character: The character.
            library: Its reactions, at the simulation's frame rate.
            config: Settings.
            threads: Threads of the simulation, 0 for all cores.
            chooser: Chooses the reactions; None for the full search (oracle).

        Raises:
            MotionError: Library, search and simulation have different frame rates.
        """
        self.character = character
        self.library = library
        self.config = config or ResponseConfig()
        fps = self.config.physics.fps
        rates = {self.config.window.fps, *(r.motion.fps for r in library.reactions)}
        if rates != {fps}:
            given = ", ".join(f"{rate:g}" for rate in sorted(rates))
            raise MotionError(
                f"the simulation has {fps:g} fps, search and reactions have {given}; expected one "
                "frame rate for all"
            )
        self.chooser = chooser or FullSearchChooser(character, library, self.config)
        self._stage = HitStage(character, self.config, threads)

    def respond(
        self,
        hits: Sequence[tuple[Motion, Impact]],
        progress: Callable[[str, int, int], None] | None = None,
    ) -> list[Response]:
        """Make a response to each hit, each on its own base motion.

        Args:
            hits: Base motions (at the simulation's frame rate) and what hits them.
            progress: Called with the stage, how many are done, and of how many.

        Returns:
            A response for each hit; one that diverges is marked and changes no other.

        Raises:
            SpecError: An impact is outside its base motion.
            MotionError: A base motion has another frame rate.
        """
        report = progress or (lambda stage, done, of: None)
        responses: dict[int, Response] = {}
        for batch in self._stage.batches(hits):
            responses.update(zip(batch.rows, self._respond_batch(batch, report), strict=True))
        return [responses[row] for row in range(len(hits))]

    # -- steps ----------------------------------------------------------------------------------

    def _respond_batch(
        self, batch: HitBatch, report: Callable[[str, int, int], None]
    ) -> list[Response]:
        """Make responses to hits that need the same scene."""
        count = len(batch.rows)
        report("simulating", 0, count)
        traces = batch.simulation.look_ahead(self.config.horizon_s)
        report("choosing", 0, count)
        seen = look_ahead_of(self.character, self.config, batch.bases, batch.prepared, traces)
        found = self.chooser.choose(seen)
        choices = {int(row): choice for row, choice in zip(seen.rows, found, strict=True)}
        report("finishing", 0, count)
        final = simulate_to_blend_end(batch.simulation, choices, self.config.transition)
        responses = [
            self._compose(base, prepared, trace, choices.get(row), final.get(row))
            for row, (base, prepared, trace) in enumerate(
                zip(batch.bases, batch.prepared, traces, strict=True)
            )
        ]
        for k, row in enumerate(seen.rows):
            responses[row] = replace(
                responses[row],
                graze=bool(seen.grazes[k]),
                speed_change=float(seen.speed_changes[k]),
                look_ahead_states=seen.states_of(k),
            )
        report("finishing", count, count)
        return responses

    def _compose(
        self,
        base: Motion,
        prepared: PreparedImpact,
        trace: Trace,
        choice: Choice | None,
        final: Trace | None,
    ) -> Response:
        """Put base motion, physics, blend and reaction together."""
        start = prepared.start
        before = base.poses[:start]
        whole = Response(base, start, prepared, trace.contact)
        if choice is None or final is None or final.diverged is not None:
            last = final or trace
            if last.diverged is None:
                # A miss: the base motion goes on.
                shown = round(self.config.carry_on_s * base.fps)
                poses = base.poses[: start + len(last.poses) + shown]
            else:
                poses = np.concatenate([before, last.poses])
            motion = self._with_contacts(base, start, poses)
            track = _impactor_track(last, start, len(motion))
            return replace(whole, motion=motion, impactor=track, diverged=last.diverged)

        assert trace.contact is not None
        length = self.config.transition.blend_frames(base.fps)
        exit_frame = trace.contact.frame + choice.exit
        simulated = final.poses[exit_frame : exit_frame + length + 1]
        end = blend_into_choice(self.character, self.config, simulated, choice)
        poses = np.concatenate([before, final.poses[:exit_frame], end.poses])
        return replace(
            whole,
            motion=self._with_contacts(base, start, poses),
            contact_frame=start + trace.contact.frame,
            exit=start + exit_frame,
            end=start + exit_frame + length,
            choice=choice.name,
            entry=choice.entry + choice.offset if choice.offset else choice.entry,
            error=choice.error,
            errors=choice.errors,
            entered_motion=choice.motion,
            simulated_after_exit=end.simulated_after_exit,
            placed_before_end=end.placed_before_end,
            impactor=_impactor_track(final, start, len(poses)),
        )

    def _with_contacts(self, base: Motion, start: int, poses: FloatArray) -> Motion:
        """The finished motion; before the simulation its foot contacts are the base motion's."""
        states = self.character.kinematics(poses[start:])
        after = foot_contacts(self.character, states, base.fps)
        return Motion(poses, base.fps, base.name, np.concatenate([base.contacts[:start], after]))


def _impactor_track(trace: Trace, start: int, frames: int) -> FloatArray | None:
    """The impactor's poses in a motion's frames, NaN where it was not simulated."""
    if trace.impactor is None:
        return None
    track = np.full((frames, 7), np.nan)
    seen = trace.impactor[: max(0, frames - start)]
    track[start : start + len(seen)] = seen
    return track
