"""The whole way of a hit: simulate, choose and align a reaction, and go back to motion capture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dynresp.errors import MotionError
from dynresp.motion.character import BodyStates, Character
from dynresp.motion.floor import raise_above
from dynresp.motion.ground import foot_contacts
from dynresp.motion.library import ReactionLibrary
from dynresp.motion.motion import Motion, pose_velocities
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Impact, PreparedImpact, prepare
from dynresp.physics.scene import ImpactorKind, Scene
from dynresp.physics.simulation import Simulation
from dynresp.physics.trace import Setup, Trace
from dynresp.response.oracle import OracleResult, search
from dynresp.response.response import CARRY_ON, GRAZE_S, Response, ResponseConfig
from dynresp.response.transition import (
    blend_onto,
    blended_targets,
    place_on,
)
from dynresp.response.windows import (
    LibraryWindows,
    ReactionTrack,
    library_windows,
    make_windows,
    trace_windows,
)


@dataclass(frozen=True)
class _Choice:
    """What was decided for one simulation; frames of the trace but for the entry."""

    name: str
    motion: Motion
    exit: int
    entry: int
    error: float
    oracle: OracleResult
    carry_on: OracleResult
    graze: bool
    speed_change: float


class Responder:
    """Answers hits on one character with one reaction library."""

    def __init__(
        self,
        character: Character,
        library: ReactionLibrary,
        config: ResponseConfig | None = None,
        threads: int = 0,
    ) -> None:
        """Cut the library's windows once.

        Args:
            character: The character.
            library: Its reactions, at the simulation's frame rate.
            config: Settings.
            threads: Threads for the physics, 0 for all cores.

        Raises:
            MotionError: Library and simulation differ in their frame rate.
        """
        self.character = character
        self.library = library
        self.config = config or ResponseConfig()
        self.threads = threads
        fps = self.config.physics.fps
        if self.config.window.fps != fps or any(r.motion.fps != fps for r in library.reactions):
            raise MotionError(f"simulation, search and library must all run at {fps:g} fps")
        left = round(max(self.config.remaining_s, self.config.transition.blend_s + 2 / fps) * fps)
        left = max(left, self.config.window.window_frames - 1)
        latest = round(self.config.entry_max_s * fps) + 1
        tracks = [
            self._track(r.name, r.motion.poses, (0, max(1, min(latest, len(r.motion) - left))))
            for r in library.reactions
        ]
        self.windows: LibraryWindows = library_windows(tracks, self.config.window)
        self._scenes: dict[ImpactorKind, Scene] = {}

    def respond(
        self,
        hits: Sequence[tuple[Motion, Impact]],
        progress: Callable[[str, int, int], None] | None = None,
    ) -> list[Response]:
        """Answer hits, each on its own base motion.

        Args:
            hits: Base motions (at the simulation's frame rate) and what hits them.
            progress: Called with the stage, how many are done, and of how many.

        Returns:
            A response for each hit; one that diverges is marked and takes no other down.

        Raises:
            SpecError: An impact lies outside its base motion.
            MotionError: A base motion has another frame rate.
        """
        for base, _ in hits:
            if base.fps != self.config.physics.fps:
                raise MotionError(
                    f"base motion {base.name!r} has {base.fps:g} fps, but the simulation runs at "
                    f"{self.config.physics.fps:g}; resample it"
                )
        tell = progress or (lambda stage, done, of: None)
        prepared = [
            prepare(impact, base, self.character, self.config.physics) for base, impact in hits
        ]
        responses: list[Response | None] = [None] * len(hits)
        for kind in ImpactorKind:
            rows = [i for i, p in enumerate(prepared) if p.kind is kind]
            if rows:
                bases = [hits[i][0] for i in rows]
                done = self._respond_alike(kind, bases, [prepared[i] for i in rows], tell)
                for i, response in zip(rows, done, strict=True):
                    responses[i] = response
        return [response for response in responses if response is not None]

    # -- steps of the way -----------------------------------------------------------------------

    def _respond_alike(
        self,
        kind: ImpactorKind,
        bases: list[Motion],
        prepared: list[PreparedImpact],
        tell: Callable[[str, int, int], None],
    ) -> list[Response]:
        """Answer hits that all need the same scene."""
        if kind not in self._scenes:
            self._scenes[kind] = Scene(self.character, kind, self.config.physics)
        setups = [
            Setup(base.poses[p.start :], p, velocity=_velocity(base, p.start))
            for base, p in zip(bases, prepared, strict=True)
        ]
        tell("simulating", 0, len(setups))
        simulation = Simulation(self._scenes[kind], setups, self.threads)
        traces = simulation.look_ahead(self.config.horizon_s)
        tell("simulating", len(setups), len(setups))
        choices: list[_Choice | None] = []
        for i, (base, setup, trace) in enumerate(zip(bases, setups, traces, strict=True)):
            tell("choosing", i, len(setups))
            hit = trace.contact is not None and trace.diverged is None
            choices.append(self._choose(base, setup.impact, trace) if hit else None)
        tell("choosing", len(setups), len(setups))
        final = self._finish(simulation, choices)
        return [
            self._compose(*row) for row in zip(bases, prepared, traces, choices, final, strict=True)
        ]

    def _track(
        self, name: str, poses: FloatArray, entries: tuple[int, int] | None = None
    ) -> ReactionTrack:
        states = self.character.kinematics(poses)
        return ReactionTrack(name, states.centers, states.quaternions, entries)

    def _choose(self, base: Motion, prepared: PreparedImpact, trace: Trace) -> _Choice:
        """The oracle's choice among all reactions and carrying on."""
        assert trace.contact is not None
        window = self.config.window
        states = self.character.kinematics(trace.poses[trace.contact.frame :])
        cut = trace_windows(states.centers, states.quaternions, window)
        result = search(cut, self.windows)

        # The base motion around the moment at which it must fit.
        contact = prepared.start + trace.contact.frame
        speed_change = self._speed_change(states, base, contact, prepared.push_duration_s)
        graze = speed_change < self.config.graze_speed
        leave_s = window.exit_min_s if graze else self.config.carry_on_exit_s
        leave = round(leave_s * base.fps)
        slack = round(self.config.carry_on_slack_s * base.fps)
        first = max(0, contact + leave - slack)
        last = contact + leave + slack
        poses = base.sample(np.arange(first, last + window.window_frames) / base.fps)
        own = library_windows([self._track(CARRY_ON, poses)], window)
        late = make_windows(states.centers, states.quaternions, [leave], window)
        carry_on = search(late, own)

        best, stay = result.best, carry_on.best
        stays = graze or stay.error <= min(best.error, self.config.carry_on_max_error)
        chosen = stay if stays else best
        return _Choice(
            name=chosen.reaction,
            motion=base if stays else self.library.reaction(best.reaction).motion,
            exit=chosen.exit_frame,
            # A base motion that ends holds its last pose.
            entry=min(first + stay.entry_frame, len(base) - 1) if stays else best.entry_frame,
            error=chosen.error,
            oracle=result,
            carry_on=carry_on,
            graze=graze,
            speed_change=speed_change,
        )

    def _speed_change(self, states: BodyStates, base: Motion, contact: int, push_s: float) -> float:
        """What a hit has done to the speed of the centre of mass over the ground [m/s].

        The difference of the simulation's and the base motion's mean velocities over 0.1 s from
        contact on; after a push that lasts, over the last 0.1 s of it that the search can see.

        Args:
            states: The simulated bodies from contact on.
            base: The base motion.
            contact: The frame of the base motion at contact.
            push_s: How long a push lasts [s], 0 for other hits.
        """
        frames = max(1, round(GRAZE_S * base.fps))
        last = max(frames, round(min(push_s, self.config.window.exit_max_s) * base.fps))
        first = last - frames
        share = self.character.masses / self.character.masses.sum()
        times = np.array([contact + first, contact + last]) / base.fps
        own = self.character.kinematics(base.sample(times)).centers
        moved = states.centers[last] - states.centers[first] - (own[1] - own[0])
        return float(np.linalg.norm((share @ moved)[:2]) * base.fps / frames)

    def _finish(
        self, simulation: Simulation, choices: Sequence[_Choice | None]
    ) -> list[Trace | None]:
        """The rest of each simulation, tracking towards what was chosen, until the blend ends."""
        length = self.config.transition.blend_frames(simulation.fps)
        final: list[Trace | None] = [None] * len(choices)
        groups: dict[int, list[int]] = {}
        targets: dict[int, FloatArray] = {}
        frames: dict[int, int] = {}
        for i, choice in enumerate(choices):
            if choice is None:
                continue
            contact = simulation.contact(i)
            assert contact is not None
            exit_frame = contact.frame + choice.exit
            back = contact.frame if self.config.transition.second_pass else exit_frame
            lead = exit_frame - back
            setup = simulation.setups[i]
            # As far as the servos read ahead.
            stop = exit_frame + length + simulation.read_ahead
            until = np.minimum(np.arange(back, stop), len(setup.base) - 1)
            targets[i] = blended_targets(
                setup.base[until], choice.motion.poses, choice.entry, lead, lead + length
            )
            frames[i] = back
            groups.setdefault(lead + length, []).append(i)
        for steps, rows in groups.items():
            traces = simulation.follow(
                rows, [frames[i] for i in rows], [targets[i] for i in rows], steps
            )
            for i, trace in zip(rows, traces, strict=True):
                final[i] = trace
        return final

    def _compose(
        self,
        base: Motion,
        prepared: PreparedImpact,
        trace: Trace,
        choice: _Choice | None,
        final: Trace | None,
    ) -> Response:
        """Put base motion, physics, blend and reaction together."""
        start = prepared.start
        before = base.poses[:start]
        shown = round(self.config.carry_on_s * base.fps)
        whole = Response(base, start, prepared, trace.contact)
        if choice is None or final is None or final.diverged is not None:
            last = final or trace
            if last.diverged is None:
                # A miss: the base motion goes on as if nothing had been.
                poses = base.poses[: start + len(last.poses) + shown]
            else:
                poses = np.concatenate([before, last.poses])
            motion = self._with_contacts(base, start, poses)
            track = _impactor_track(last, start, len(motion))
            return replace(whole, motion=motion, impactor=track, diverged=last.diverged)

        assert trace.contact is not None
        length = self.config.transition.blend_frames(base.fps)
        out = trace.contact.frame + choice.exit
        simulated = final.poses[out : out + length + 1]
        left = len(choice.motion) - choice.entry
        if choice.name == CARRY_ON:
            left = min(left, length + 1 + shown)
        # Where a motion ends before the blend does, its last pose holds.
        at = choice.entry + np.arange(max(left, length + 2))
        entered = choice.motion.poses[np.minimum(at, len(choice.motion) - 1)]
        placed = place_on(entered, 0, simulated[0])
        # Halfway between two poses that stand, legs can reach below the floor.
        blend = blend_onto(simulated, placed[: length + 1])
        blend = raise_above(self.character, blend, base.fps)
        poses = np.concatenate([before, final.poses[:out], blend, placed[length + 1 :]])
        found = zip(choice.oracle.names, choice.oracle.errors, strict=True)
        return replace(
            whole,
            motion=self._with_contacts(base, start, poses),
            contact_frame=start + trace.contact.frame,
            exit=start + out,
            end=start + out + length,
            choice=choice.name,
            entry=choice.entry,
            error=choice.error,
            graze=choice.graze,
            speed_change=choice.speed_change,
            errors={n: float(e) for n, e in found} | {CARRY_ON: choice.carry_on.best.error},
            oracle=choice.oracle,
            carry_on=choice.carry_on,
            entered=choice.motion,
            left=simulated[1],
            joined=placed[length - 1],
            impactor=_impactor_track(final, start, len(poses)),
        )

    def _with_contacts(self, base: Motion, start: int, poses: FloatArray) -> Motion:
        """The finished motion; until the simulation starts its foot contacts are the base's."""
        states = self.character.kinematics(poses[start:])
        after = foot_contacts(self.character, states, base.fps)
        return Motion(poses, base.fps, base.name, np.concatenate([base.contacts[:start], after]))


def _velocity(motion: Motion, frame: int) -> FloatArray:
    """A motion's velocity (45,) at a frame, by the central difference where there is one."""
    first = max(frame - 1, 0)
    return pose_velocities(motion.poses[first : frame + 2], motion.fps)[frame - first]


def _impactor_track(trace: Trace, start: int, frames: int) -> FloatArray | None:
    """The impactor's poses in a motion's frames, NaN where it was not simulated."""
    if trace.impactor is None:
        return None
    track = np.full((frames, 7), np.nan)
    seen = trace.impactor[: max(0, frames - start)]
    track[start : start + len(seen)] = seen
    return track
