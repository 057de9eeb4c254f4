"""Characters at run time, advanced together frame by frame; their simulations share batches."""

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
from dynresp.response.runtime.dynamic_responder import DynamicResponder, EventKind, Flight, Phase
from dynresp.response.search.full_search_choice import FullSearchChooser
from dynresp.response.transition.choice_to_motion import ending, finish
from dynresp.response.transition.transition import blend_onto, place_on
from dynresp.support.errors import MotionError, UsageError


class Crowd:
    """Characters that play motions and answer hits as they come.

    A hit is answered as by `Responder`, frame by frame; each character has the bits that it would
    have alone.

    Attributes:
        responders: The characters.
        config: Settings.
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
        """Make ready.

        Args:
            character: The body of all of them.
            library: Its reactions, at the simulation's frame rate.
            bases: What each plays, at that rate.
            config: Settings.
            chooser: What chooses, made for the same character and library with the same settings;
                None for the oracle.
            threads: Threads for the physics, 0 for all cores.
            stage: Where scenes are kept, for several crowds of one body and the same settings,
                with its own number of threads; None for one of its own.

        Raises:
            MotionError: There is no base motion, or a motion has another frame rate.
            UsageError: The chooser was made for something else.
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
        self.responders = tuple(
            DynamicResponder(base, character, self.config.physics) for base in bases
        )
        self._character = character
        self._chooser = chooser or FullSearchChooser(character, library, self.config)
        self._stage = stage or HitStage(character, self.config, threads)
        self._simulations: dict[ImpactorKind, Simulation] = {}

    def advance(self) -> FloatArray:
        """Go on by one frame.

        Returns:
            (characters, 59) what they show.
        """
        for i, responder in enumerate(self.responders):
            flight = responder.launch()
            if flight is not None:
                self._put(i, flight)
        for kind, simulation in self._simulations.items():
            ids = [
                i for i, flight in self._flights(Phase.APPROACH) if flight.setup.impact.kind is kind
            ]
            if ids:
                self._approach(simulation, ids)
        for i, responder in enumerate(self.responders):
            self._show(i, responder)
        return np.stack([responder.pose for responder in self.responders])

    # -- stages of a hit ------------------------------------------------------------------------

    def _flights(self, phase: Phase) -> Iterable[tuple[int, Flight]]:
        for i, responder in enumerate(self.responders):
            if responder.phase is phase and responder.flight is not None:
                yield i, responder.flight

    def _put(self, i: int, flight: Flight) -> None:
        """Put a hit into the batch of its kind, where every character has a place."""
        kind = flight.setup.impact.kind
        if kind in self._simulations:
            self._simulations[kind].replace(i, flight.setup)
            return
        # Until its turn comes a character's place holds a copy that is not run.
        setups = [flight.setup] * len(self.responders)
        self._simulations[kind] = Simulation(self._stage.scene(kind), setups, self._stage.threads)

    def _approach(self, simulation: Simulation, ids: list[int]) -> None:
        """One frame towards contact, and what follows from it."""
        for i in ids:
            # What it plays may have been changed.
            simulation.setups[i] = self._flight(i).setup
        simulation.approach(ids)
        hit = []
        for i in ids:
            if simulation.diverged(i) is not None:
                self._give_up(i, EventKind.DIVERGED)
            elif simulation.contact(i) is not None:
                hit.append(i)
            elif simulation.frame(i) >= simulation.due(i):
                self._give_up(i, EventKind.MISSED, simulation)
        if hit:
            self._plan(simulation, hit)

    def _plan(self, simulation: Simulation, ids: list[int]) -> None:
        """Events 2 to 4: look ahead, choose, and take the simulation back."""
        horizon = simulation.frames_of(self.config.horizon_s)
        left: dict[int, list[int]] = {}
        for i in ids:
            contact = simulation.contact(i)
            assert contact is not None
            left.setdefault(contact.frame + horizon - simulation.frame(i), []).append(i)
        for frames, alike in left.items():
            simulation.go_on(alike, frames)
        flights = [self._flight(i) for i in ids]
        traces = [simulation.trace(i) for i in ids]
        seen = look_ahead_of(
            self._character,
            self.config,
            [flight.base for flight in flights],
            [flight.setup.impact for flight in flights],
            traces,
        )
        choices = dict(zip(seen.rows.tolist(), self._chooser.choose(seen), strict=True))
        for row, (i, flight, trace) in enumerate(zip(ids, flights, traces, strict=True)):
            if row not in choices:
                self._give_up(i, EventKind.DIVERGED)
                continue
            assert trace.contact is not None
            choice = choices[row]
            responder = self.responders[i]
            contact_frame = flight.launch + trace.contact.frame
            flight.choice, flight.trace = choice, trace
            flight.exit = contact_frame + choice.exit
            responder.phase = Phase.PHYSICS
            responder.tell(EventKind.CONTACT, contact_frame)
            responder.tell(EventKind.CHOSEN, contact_frame, choice)
            if self.config.transition.second_pass:
                # All of what follows the contact is simulated anew, towards what was chosen.
                flight.trace = finish(simulation, {i: choice}, self.config.transition)[i]
                if flight.trace.diverged is not None:
                    self._give_up(i, EventKind.DIVERGED)
                    continue
            else:
                simulation.rewind(i, trace.contact.frame + choice.exit)
            responder.tell(EventKind.REWOUND, contact_frame)

    def _begin_blend(self, i: int, flight: Flight, choice: Choice) -> None:
        """Event 5: the rest of the simulation, and the blend."""
        responder = self.responders[i]
        transition = self.config.transition
        final = flight.trace
        if not transition.second_pass:
            simulation = self._simulations[flight.setup.impact.kind]
            final = finish(simulation, {i: choice}, transition)[i]
        assert final is not None
        if final.diverged is not None:
            self._give_up(i, EventKind.DIVERGED)
            return
        out = flight.exit - flight.launch
        simulated = final.poses[out : out + transition.blend_frames(self.config.physics.fps) + 1]
        end = ending(self._character, self.config, simulated, choice)
        flight.end = flight.exit + transition.blend_frames(self.config.physics.fps)
        responder.enter(choice, simulated[0], end.poses)
        responder.tell(EventKind.BLEND_BEGUN, flight.exit)

    def _give_up(self, i: int, why: EventKind, simulation: Simulation | None = None) -> None:
        """Blend from where the character is back to what it did.

        Args:
            i: Which.
            why: The event.
            simulation: Where it goes on meanwhile; without, it stops where it is.
        """
        responder, flight = self.responders[i], self._flight(i)
        length = self.config.transition.blend_frames(self.config.physics.fps)
        responder.tell(why)
        start = responder.pose
        simulated = np.repeat(start[None], length + 1, axis=0)
        if simulation is not None:
            first = simulation.frame(i) - 1
            targets = responder.planned(responder.frame, length + simulation.read_ahead)
            trace = simulation.follow([i], [first], [targets], length)[0]
            if trace.diverged is None:
                simulated = trace.poses[first : first + length + 1]
        # One that was held is where its plan is; another is met where it stands.
        base = responder.planned(responder.frame, length + 1)
        placed = base if flight.setup.held else place_on(base, 0, start)
        blend = blend_onto(simulated, placed)
        blend = raise_above(self._character, blend, self.config.physics.fps)
        flight.exit, flight.end = responder.frame, responder.frame + length
        responder.go_back(None if flight.setup.held else start, blend)

    def _show(self, i: int, responder: DynamicResponder) -> None:
        """The next frame of one character."""
        following = responder.frame + 1
        flight = responder.flight
        leaving = responder.phase is Phase.PHYSICS and flight and following >= flight.exit
        if leaving and flight and flight.choice:
            self._begin_blend(i, flight, flight.choice)
        if responder.phase is Phase.APPROACH and flight:
            simulation = self._simulations[flight.setup.impact.kind]
            responder.show(simulation.pose(i))
        elif responder.phase is Phase.PHYSICS and flight and flight.trace:
            responder.show(flight.trace.poses[following - flight.launch])
        else:
            responder.show(responder.planned(following, 1)[0])
        if responder.phase is Phase.BLEND and flight and following >= flight.end:
            responder.phase = Phase.PLAYING
            responder.tell(EventKind.BLEND_ENDED)

    def _flight(self, i: int) -> Flight:
        flight = self.responders[i].flight
        assert flight is not None
        return flight


def _check_chooser(
    chooser: Chooser, character: Character, library: ReactionLibrary, config: ResponseConfig
) -> None:
    """Refuse a chooser that was made for something else, before a hit finds it out."""
    for what, same in (
        ("character", chooser.character.identity == character.identity),
        ("library", chooser.library.identity == library.identity),
        ("config", chooser.config == config),
    ):
        if not same:
            raise UsageError(
                f"the chooser was made with another {what} than the crowd's; make it with the "
                "character, the library and the config that the crowd is given"
            )
