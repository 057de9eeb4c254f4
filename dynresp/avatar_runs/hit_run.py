"""An outing with hits: an avatar walks by graph, balls hit it, and it walks on."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dynresp.avatar_runs.avatar_run import Outing, skate
from dynresp.locomotion.avatar.avatar import Activity, Avatar, RandomPlanner
from dynresp.locomotion.avatar.avatar_crowd import AvatarCrowd
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import IDENTITY
from dynresp.motion.character import Character
from dynresp.motion.ground import foot_contacts
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import default_library
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Ball
from dynresp.response.chooser import ChoiceTable, make_chooser
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.response.runtime.dynamic_responder import Event, EventKind, Flight, Phase
from dynresp.support.progress import Progress
from dynresp.view.story import MovingSphere, PhaseName, StoryEvent, StoryPhase

# Balls: mass [kg], speed [m/s], height [m]; and from the launch of one to that of the next [s].
_MASS, _SPEED, _HEIGHT = (3.0, 8.0), (5.0, 13.0), (0.5, 1.6)
_BETWEEN_S = (4.0, 8.0)
_FIRST_S = 2.0
# What an event is called in the pictures.
_NAMES = {
    EventKind.CONTACT: "contact",
    EventKind.BLEND_BEGUN: "exit",
    EventKind.BLEND_ENDED: "blend ends",
    EventKind.MISSED: "missed",
}


def hit_outing(
    graph: MotionGraph,
    character: Character,
    folders: list[Path],
    seconds: float,
    seed: int,
    progress: Progress,
) -> Outing:
    """Walk by chance while somebody throws balls.

    Args:
        graph: What is walked through.
        character: Whose body it is.
        folders: Motions folders, for the reactions.
        seconds: How long.
        seed: Of where it walks, and of the balls.
        progress: Told how much is simulated.

    Raises:
        DynrespError: The reactions cannot be read.
    """
    response = ResponseConfig()
    fps = response.physics.fps
    library = default_library(folders, character, fps)
    choosing = make_chooser(ChoiceTable(), character, library, response, Path())
    rng = np.random.default_rng(seed)
    start = int(rng.choice(graph.frames))
    crowd = AvatarCrowd(
        character, library, graph, [RandomPlanner(graph, np.random.default_rng([seed, 1]))],
        [(start, IDENTITY)], response=response, chooser=choosing.chooser,
    )  # fmt: skip
    avatar = crowd.avatars[0]
    watcher = _Watcher(avatar)
    frames, due = round(seconds * fps), round(_FIRST_S * fps)
    for frame in range(frames):
        progress("walking and being hit", frame, frames)
        if frame >= due and frame < frames - fps:
            avatar.responder.hit(_some_ball(rng))
            due = frame + round(rng.uniform(*_BETWEEN_S) * fps)
        crowd.advance()
        watcher.look()
    motion = watcher.motion(character)
    returns = [  # of the last hundred those that are within the motion
        {
            "after": back.reaction,
            # The first frame that is shown is frame 1 of the clock.
            "left_s": None if back.moment is None else (back.moment - 1) / fps,
            "distance": None if back.entry is None else back.entry.distance,
        }
        for back in avatar.returns
        if back.moment is None or back.moment <= frames
    ]
    hits = sum(event.name == "contact" for event in watcher.events)
    return Outing(
        title="A walk with balls thrown at it",
        subtitle=f"{hits} hits in {seconds:.0f} s, reactions of the library {library.name!r}, "
        f"seed {seed}",
        motion=motion,
        jumps_s=None,
        spheres=watcher.spheres(),
        events=[event for event in watcher.events if event.time_s <= (frames - 1) / fps],
        phases=watcher.phases(),
        about={
            "seed": seed,
            "choice": choosing.record,
            "returns": returns,
            "foot_skate_by_part_m": watcher.skates(motion, character),
        },
    )


def _some_ball(rng: np.random.Generator) -> Ball:
    return Ball(
        time=1.0,
        mass=float(rng.uniform(*_MASS)),
        speed=float(rng.uniform(*_SPEED)),
        from_deg=float(rng.uniform(0.0, 360.0)),
        height=float(rng.uniform(*_HEIGHT)),
    )


class _Watcher:
    """Notes what an avatar shows, frame by frame, for a story."""

    def __init__(self, avatar: Avatar) -> None:
        self.poses: list[FloatArray] = []
        self.events: list[StoryEvent] = []
        self._avatar, self._responder = avatar, avatar.responder
        self._fps = avatar.responder.physics.fps
        self._driven: list[PhaseName] = []
        self._parts: list[str] = []
        self._standing: list[npt.NDArray[np.bool_] | None] = []
        self._flights: list[Flight] = []
        self._last: Event | None = None

    def look(self) -> None:
        """Note the frame that is shown now."""
        responder = self._responder
        self.poses.append(responder.pose)
        fresh = itertools.takewhile(lambda e: e is not self._last, reversed(responder.events))
        for event in reversed(list(fresh)):
            self._last = event
            if event.kind in _NAMES:
                # The first frame that is shown is frame 1 of the clock.
                self.events.append(
                    StoryEvent(_NAMES[event.kind], max(event.frame - 1, 0) / self._fps)
                )
        flight = responder.flight
        if flight is not None and (not self._flights or self._flights[-1] is not flight):
            self._flights.append(flight)
        self._driven.append(self._name_of_phase())
        standing = self._avatar.standing
        self._standing.append(standing)
        self._parts.append("graph" if standing is not None else responder.phase.value)

    def motion(self, character: Character) -> Motion:
        """What was shown; on its way through the graph with the graph's foot contacts."""
        poses = np.array(self.poses)
        contacts = foot_contacts(character, character.kinematics(poses), self._fps)
        for k, standing in enumerate(self._standing):
            if standing is not None:
                contacts[k] = standing
        return Motion(poses, self._fps, "walking by graph, and hit", contacts)

    def skates(self, motion: Motion, character: Character) -> dict[str, dict[str, float] | None]:
        """How far feet slide in stances, or what of them lies in a part of the motion [m].

        The parts are the way through the graph ("graph"), and what else moved the avatar
        (`dynresp.response.runtime.dynamic_responder.Phase`), of which "playing" is a reaction
        after its blend.
        """
        parts = np.array(self._parts)
        return {
            part: skate(
                replace(motion, contacts=motion.contacts & (parts == part)[:, None]), character
            )
            for part in dict.fromkeys(self._parts)
        }

    def phases(self) -> list[StoryPhase]:
        """What drove the avatar when."""
        edges = [k for k in range(1, len(self._driven)) if self._driven[k] != self._driven[k - 1]]
        bounds = [0, *edges, len(self._driven)]
        return [
            StoryPhase(self._driven[a], a / self._fps, b / self._fps)
            for a, b in itertools.pairwise(bounds)
        ]

    def spheres(self) -> list[MovingSphere]:
        """The balls, from their launch until they are simulated no more."""
        balls = []
        for number, flight in enumerate(self._flights, 1):
            if flight.trace is None or flight.trace.impactor is None:
                continue
            track = np.full((len(self.poses), 3), np.nan)
            way = flight.trace.impactor[:, :3]
            first = flight.launch - 1
            stop = min(first + len(way), len(track))
            track[max(first, 0) : stop] = way[max(-first, 0) : stop - first]
            balls.append(MovingSphere(f"ball {number}", flight.setup.impact.radius, track))
        return balls

    def _name_of_phase(self) -> PhaseName:
        driven = self._responder.phase
        if driven is Phase.PHYSICS:
            return "physics"
        if driven is Phase.BLEND:
            return "blend"
        if driven is Phase.PLAYING and self._avatar.activity is not Activity.WALKING:
            return "reaction"
        last = self._avatar.returns[-1] if self._avatar.returns else None
        if last is not None and last.moment is not None and last.reaction != CARRY_ON:
            return "reaction" if self._responder.frame <= last.moment else "base motion"
        return "base motion"
