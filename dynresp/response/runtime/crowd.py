"""`Crowd`: characters at run time that advance together, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.motion.retargeting.floor import raise_above
from dynresp.motion.rotations import FloatArray
from dynresp.physics.scene import ImpactorKind
from dynresp.physics.simulation import Simulation
from dynresp.response.choice import Choice, Chooser
from dynresp.response.hit_simulation import HitStage
from dynresp.response.look_ahead import look_ahead_of
from dynresp.response.response import ResponseConfig
from dynresp.response.runtime.dynamic_responder import (
    DynamicResponder,
    EventKind,
    Phase,
    SimulatedHit,
)
from dynresp.response.search.full_search_choice import FullSearchChooser
from dynresp.response.transition.choice_to_motion import (
    blend_into_choice,
    simulate_to_blend_end,
)
from dynresp.response.transition.transition import blend_onto, place_on
from dynresp.support.errors import MotionError, UsageError


class Crowd:
    """Characters that play motions and react to hits at any moment, frame by frame.

    A character reacts as in `dynresp.hit`, but hits can come while the crowd runs, also while it
    still reacts to an earlier one. Simulations of one kind of impact run together on all cores;
    each character has bit for bit the poses that it would have alone.

    Attributes:
        responders: The characters, in the order of `bases`. `responders[i].hit(impact)` lets
            something hit character i; its `pose`, `phase` and `events` say what it does.
        config: Settings of simulation, search and blend.

    Examples:
        >>> import dynresp
        >>> library = dynresp.load_library("builtin")
        >>> walk = dynresp.load_motion("builtin:walk").resampled(30)
        >>> crowd = dynresp.Crowd(dynresp.Character(), library, [walk, walk])
        >>> crowd.responders[0].hit(dynresp.Ball(time=0.5, from_deg=180))
        >>> for frame in range(60):
        ...     poses = crowd.advance()
        >>> poses.shape
        (2, 59)
    """

    def __init__(
        self,
        character: Character,
        library: ReactionLibrary,
        bases: Sequence[Motion],
        config: ResponseConfig | None = None,
        chooser: Chooser | None = None,
        threads: int = 0,
        stage: HitStage | None = None,
    ) -> None:
        """Create the characters, each at the first frame of its base motion.

        Args:
            character: The body of all of them.
            library: Its reactions, at the simulation's frame rate (30 frames a second by default).
            bases: The base motion of each character, at that frame rate; after its last frame the
                last pose holds.
            config: Settings of simulation, search and blend; None for the defaults.
            chooser: Chooses the reactions (`dynresp.response.budget.chooser_for`), made for the
                same character, library and settings; None for the full search (oracle).
            threads: Threads for the simulation, 0 for all cores.
            stage: Keeps compiled scenes for several crowds with the same character and settings;
                its own number of threads counts. None for a new one.

        Raises:
            MotionError: There is no base motion, or a motion has another frame rate.
            UsageError: The chooser was made for another character, library or config.
        """
        if not bases:
            raise MotionError("a crowd needs at least one base motion; none was given")
        self.config = config or ResponseConfig()
        fps = self.config.physics.fps
        for motion in [*bases, *(reaction.motion for reaction in library.reactions)]:
            if motion.fps != fps:
                raise MotionError(
                    f"motion {motion.name!r} has {motion.fps:g} fps, but the simulation runs at "
                    f"{fps:g}; resample it"
                )
        if chooser is not None:
            _check_chooser(chooser, character, library, self.config)
        _compile_kernels()
        self.responders = tuple(
            DynamicResponder(base, character, self.config.physics) for base in bases
        )
        self._character = character
        self._chooser = chooser or FullSearchChooser(character, library, self.config)
        self._stage = stage or HitStage(character, self.config, threads)
        self._simulations: dict[ImpactorKind, Simulation] = {}

    def advance(self) -> FloatArray:
        """Advance all characters by one frame.

        Returns:
            (characters, 59) the poses that they show now: root position [m], then quaternions
            w x y z of the root and the 13 joints.
        """
        for i, responder in enumerate(self.responders):
            hit = responder.start_hit()
            if hit is not None:
                self._start_simulation(i, hit)
        for kind, simulation in self._simulations.items():
            ids = [i for i, hit in self._hits_in(Phase.APPROACH) if hit.setup.impact.kind is kind]
            if ids:
                self._approach(simulation, ids)
        for i, responder in enumerate(self.responders):
            self._show(i, responder)
        return np.stack([responder.pose for responder in self.responders])

    # -- stages of a hit ------------------------------------------------------------------------

    def _hits_in(self, phase: Phase) -> Iterable[tuple[int, SimulatedHit]]:
        for i, responder in enumerate(self.responders):
            if responder.phase is phase and responder.last_hit is not None:
                yield i, responder.last_hit

    def _start_simulation(self, i: int, hit: SimulatedHit) -> None:
        """Put a hit into the batch of its kind, in which every character has a row."""
        kind = hit.setup.impact.kind
        if kind in self._simulations:
            self._simulations[kind].replace(i, hit.setup)
            return
        # The rows of the other characters hold copies that do not run.
        setups = [hit.setup] * len(self.responders)
        self._simulations[kind] = Simulation(self._stage.scene(kind), setups, self._stage.threads)

    def _approach(self, simulation: Simulation, ids: list[int]) -> None:
        """Simulate one frame before contact, and handle contact, miss or divergence in it."""
        for i in ids:
            # `DynamicResponder.play` may have changed what the character tracks.
            simulation.setups[i] = self._last_hit(i).setup
        simulation.approach(ids)
        touched = []
        for i in ids:
            if simulation.diverged(i) is not None:
                self._give_up(i, EventKind.DIVERGED)
            elif simulation.contact(i) is not None:
                touched.append(i)
            elif simulation.frame(i) >= simulation.due(i):
                self._give_up(i, EventKind.MISSED, simulation)
        if touched:
            self._choose(simulation, touched)

    def _choose(self, simulation: Simulation, ids: list[int]) -> None:
        """Events 2 to 4: look ahead, choose, and take the simulation back."""
        horizon = simulation.frames_of(self.config.horizon_s)
        remaining: dict[int, list[int]] = {}
        for i in ids:
            contact = simulation.contact(i)
            assert contact is not None
            remaining.setdefault(contact.frame + horizon - simulation.frame(i), []).append(i)
        for frames, rows in remaining.items():
            simulation.go_on(rows, frames)
        simulated_hits = [self._last_hit(i) for i in ids]
        traces = [simulation.trace(i) for i in ids]
        seen = look_ahead_of(
            self._character,
            self.config,
            [hit.base for hit in simulated_hits],
            [hit.setup.impact for hit in simulated_hits],
            traces,
        )
        choices = dict(zip(seen.rows.tolist(), self._chooser.choose(seen), strict=True))
        for row, (i, hit, trace) in enumerate(zip(ids, simulated_hits, traces, strict=True)):
            if row not in choices:
                self._give_up(i, EventKind.DIVERGED)
                continue
            assert trace.contact is not None
            choice = choices[row]
            responder = self.responders[i]
            contact_frame = hit.start + trace.contact.frame
            hit.choice, hit.trace = choice, trace
            hit.exit = contact_frame + choice.exit
            responder.phase = Phase.PHYSICS
            responder.add_event(EventKind.CONTACT, contact_frame)
            responder.add_event(EventKind.CHOSEN, contact_frame, choice)
            if self.config.transition.second_pass:
                # Everything after contact is simulated again, towards the choice.
                transition = self.config.transition
                hit.trace = simulate_to_blend_end(simulation, {i: choice}, transition)[i]
                if hit.trace.diverged is not None:
                    self._give_up(i, EventKind.DIVERGED)
                    continue
            else:
                simulation.rewind(i, trace.contact.frame + choice.exit)
            responder.add_event(EventKind.REWOUND, contact_frame)

    def _begin_blend(self, i: int, hit: SimulatedHit, choice: Choice) -> None:
        """Event 5: simulate the rest, and blend."""
        responder = self.responders[i]
        transition = self.config.transition
        final = hit.trace
        if not transition.second_pass:
            simulation = self._simulations[hit.setup.impact.kind]
            final = simulate_to_blend_end(simulation, {i: choice}, transition)[i]
        assert final is not None
        if final.diverged is not None:
            self._give_up(i, EventKind.DIVERGED)
            return
        out = hit.exit - hit.start
        simulated = final.poses[out : out + transition.blend_frames(self.config.physics.fps) + 1]
        end = blend_into_choice(self._character, self.config, simulated, choice)
        hit.end = hit.exit + transition.blend_frames(self.config.physics.fps)
        responder.enter(choice, simulated[0], end.poses)
        responder.add_event(EventKind.BLEND_BEGUN, hit.exit)

    def _give_up(self, i: int, event: EventKind, simulation: Simulation | None = None) -> None:
        """Blend from the present pose back to the motion that was played.

        Args:
            i: The character.
            event: `EventKind.MISSED` or `EventKind.DIVERGED`.
            simulation: Simulates the character during the blend; None holds the present pose.
        """
        responder, hit = self.responders[i], self._last_hit(i)
        length = self.config.transition.blend_frames(self.config.physics.fps)
        responder.add_event(event)
        start = responder.pose
        simulated = np.repeat(start[None], length + 1, axis=0)
        if simulation is not None:
            first = simulation.frame(i) - 1
            targets = responder.planned(responder.frame, length + simulation.read_ahead)
            trace = simulation.follow([i], [first], [targets], length)[0]
            if trace.diverged is None:
                simulated = trace.poses[first : first + length + 1]
        # A character that was held is where its timeline is. Another one has moved away from it, so
        # the timeline is placed on its present pose.
        base = responder.planned(responder.frame, length + 1)
        placed = base if hit.setup.held else place_on(base, 0, start)
        blend = blend_onto(simulated, placed)
        blend = raise_above(self._character, blend, self.config.physics.fps)
        hit.exit, hit.end = responder.frame, responder.frame + length
        responder.go_back(None if hit.setup.held else start, blend)

    def _show(self, i: int, responder: DynamicResponder) -> None:
        """Show the next frame of one character."""
        following = responder.frame + 1
        hit = responder.last_hit
        leaving = responder.phase is Phase.PHYSICS and hit and following >= hit.exit
        if leaving and hit and hit.choice:
            self._begin_blend(i, hit, hit.choice)
        if responder.phase is Phase.APPROACH and hit:
            simulation = self._simulations[hit.setup.impact.kind]
            responder.show(simulation.pose(i))
        elif responder.phase is Phase.PHYSICS and hit and hit.trace:
            responder.show(hit.trace.poses[following - hit.start])
        else:
            responder.show(responder.planned(following, 1)[0])
        if responder.phase is Phase.BLEND and hit and following >= hit.end:
            responder.phase = Phase.PLAYING
            responder.add_event(EventKind.BLEND_ENDED)

    def _last_hit(self, i: int) -> SimulatedHit:
        hit = self.responders[i].last_hit
        assert hit is not None
        return hit


def _check_chooser(
    chooser: Chooser, character: Character, library: ReactionLibrary, config: ResponseConfig
) -> None:
    """Refuse a chooser that was made for something else."""
    for what, same in (
        ("character", chooser.character.identity == character.identity),
        ("library", chooser.library.identity == library.identity),
        ("config", chooser.config == config),
    ):
        if not same:
            raise UsageError(
                f"the chooser was made with another {what} than the crowd; make it with the "
                "character, the library and the config of the crowd"
            )


def _compile_kernels() -> None:
    """Compile what a hit needs, or load it: no frame is to wait for that, or for Python."""
    from dynresp.motion.feet.foot_fitting_kernel import correct_kernel
    from dynresp.motion.feet.skating_kernel import slides_kernel
    from dynresp.response.alignment.alignment_kernel import align_kernel, errors_kernel
    from dynresp.response.prediction.hit_features_kernel import features_kernel

    for kernel in (features_kernel, errors_kernel, align_kernel, slides_kernel, correct_kernel):
        kernel.compiled()
