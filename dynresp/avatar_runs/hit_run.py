"""A walk by chance with balls thrown at the avatar: it is hit, reacts, and walks on."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dynresp.avatar_runs.avatar_run import AvatarRun, foot_slide
from dynresp.avatar_runs.world_setup import refuse_terrain
from dynresp.locomotion.avatar.avatar import Activity, Avatar, RandomPlanner
from dynresp.locomotion.avatar.avatar_crowd import AvatarCrowd
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import IDENTITY
from dynresp.motion.character import Character
from dynresp.motion.ground import foot_contacts
from dynresp.motion.motion import Motion
from dynresp.motion.reactions.reaction_library import ReactionLibrary
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Ball
from dynresp.response.chooser import ChoiceTable, make_chooser
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.response.runtime.dynamic_responder import Event, EventKind, Phase, SimulatedHit
from dynresp.support.progress import Progress, no_progress
from dynresp.view.story import MovingSphere, PhaseName, StoryEvent, StoryPhase

# Ranges from which a ball is drawn: mass [kg], speed [m/s], height [m], and the time between two
# balls [s].
_MASS, _SPEED, _HEIGHT = (3.0, 8.0), (5.0, 13.0), (0.5, 1.6)
_INTERVAL_S = (4.0, 8.0)
_FIRST_S = 2.0
# Names of events in the pictures.
_NAMES = {
    EventKind.CONTACT: "contact",
    EventKind.BLEND_BEGUN: "exit",
    EventKind.BLEND_ENDED: "blend ends",
    EventKind.MISSED: "missed",
}


def hit_run(
    graph: MotionGraph,
    character: Character,
    library: ReactionLibrary,
    seconds: float = 20.0,
    seed: int = 0,
    progress: Progress = no_progress,
) -> AvatarRun:
    """Walk by chance while balls are thrown at the avatar every few seconds.

    The classifier that comes with the library chooses reactions; without one the full search (the
    oracle) does.

    Args:
        graph: The motion graph; not one of rough terrain.
        character: The avatar's body.
        library: Its reactions, at 30 frames a second, the rate of the physics and of the motion.
        seconds: How long it walks [s].
        seed: Seed of the walk and of the balls.
        progress: Called with the stage, how many frames are done, and of how many.

    Raises:
        UsageError: The graph is one of rough terrain, or of another character.
        MotionError: The library has another frame rate.

    Example:
        >>> import dynresp
        >>> from dynresp.motion.character import default_character
        >>> graph, library = dynresp.build_graph("builtin"), dynresp.load_library("builtin")
        >>> run = hit_run(graph, default_character(), library, seconds=8.0, seed=1)
        >>> "contact" in {event.name for event in run.events}
        True
        >>> content = run.save("hits", video=False)
    """
    refuse_terrain(graph)
    response = ResponseConfig()
    fps = response.physics.fps
    choosing = make_chooser(ChoiceTable(), character, library, response, Path())
    rng = np.random.default_rng(seed)
    start = int(rng.choice(graph.frames))
    crowd = AvatarCrowd(
        character, library, graph, [RandomPlanner(graph, np.random.default_rng([seed, 1]))],
        [(start, IDENTITY)], response=response, chooser=choosing.chooser,
    )  # fmt: skip
    avatar = crowd.avatars[0]
    recorder = _Recorder(avatar)
    frames, next_ball = round(seconds * fps), round(_FIRST_S * fps)
    for frame in range(frames):
        progress("walking and being hit", frame, frames)
        if frame >= next_ball and frame < frames - fps:
            avatar.responder.hit(_random_ball(rng))
            next_ball = frame + round(rng.uniform(*_INTERVAL_S) * fps)
        crowd.advance()
        recorder.record()
    motion = recorder.motion(character)
    # The avatar keeps its last hundred returns; those after the motion's end do not count.
    returns = [
        {
            "after": back.reaction,
            # The first frame that is shown is frame 1 of the clock.
            "left_s": None if back.moment is None else (back.moment - 1) / fps,
            "distance": None if back.entry is None else back.entry.distance,
        }
        for back in avatar.returns
        if back.moment is None or back.moment <= frames
    ]
    hits = sum(event.name == "contact" for event in recorder.events)
    return AvatarRun(
        graph,
        character,
        title="A walk with balls thrown at it",
        subtitle=f"{hits} hits in {seconds:.0f} s, reactions of the library {library.name!r}, "
        f"seed {seed}",
        motion=motion,
        jumps_s=None,
        spheres=recorder.spheres(),
        events=[event for event in recorder.events if event.time_s <= (frames - 1) / fps],
        phases=recorder.phases(),
        about={
            "seed": seed,
            "choice": choosing.record,
            "returns": returns,
            "foot_skate_by_part_m": recorder.foot_slides(motion, character),
        },
    )


def _random_ball(rng: np.random.Generator) -> Ball:
    return Ball(
        time=1.0,
        mass=float(rng.uniform(*_MASS)),
        speed=float(rng.uniform(*_SPEED)),
        from_deg=float(rng.uniform(0.0, 360.0)),
        height=float(rng.uniform(*_HEIGHT)),
    )


class _Recorder:
    """Records what an avatar shows, frame by frame."""

    def __init__(self, avatar: Avatar) -> None:
        self.poses: list[FloatArray] = []
        self.events: list[StoryEvent] = []
        self._avatar, self._responder = avatar, avatar.responder
        self._fps = avatar.responder.physics.fps
        self._drivers: list[PhaseName] = []
        self._parts: list[str] = []
        self._standing: list[npt.NDArray[np.bool_] | None] = []
        self._hits: list[SimulatedHit] = []
        self._last: Event | None = None

    def record(self) -> None:
        """Record the frame that is shown now."""
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
        hit = responder.last_hit
        if hit is not None and (not self._hits or self._hits[-1] is not hit):
            self._hits.append(hit)
        self._drivers.append(self._name_of_phase())
        standing = self._avatar.standing
        self._standing.append(standing)
        self._parts.append("graph" if standing is not None else responder.phase.value)

    def motion(self, character: Character) -> Motion:
        """What was shown. Foot contacts of the walk through the graph are the graph's own."""
        poses = np.array(self.poses)
        contacts = foot_contacts(character, character.kinematics(poses), self._fps)
        for k, standing in enumerate(self._standing):
            if standing is not None:
                contacts[k] = standing
        return Motion(poses, self._fps, "walking by graph, and hit", contacts)

    def foot_slides(
        self, motion: Motion, character: Character
    ) -> dict[str, dict[str, float] | None]:
        """How far feet slide in stances [m], by what moved the avatar; see `foot_slide`.

        The keys are "graph" for the walk through the graph, else a value of
        `dynresp.response.runtime.dynamic_responder.Phase`, of which "playing" is a reaction after
        its blend. Of a stance that is in two parts each part counts by itself.
        """
        parts = np.array(self._parts)
        return {
            part: foot_slide(
                replace(motion, contacts=motion.contacts & (parts == part)[:, None]), character
            )
            for part in dict.fromkeys(self._parts)
        }

    def phases(self) -> list[StoryPhase]:
        """What drove the avatar when."""
        drivers = self._drivers
        edges = [k for k in range(1, len(drivers)) if drivers[k] != drivers[k - 1]]
        bounds = [0, *edges, len(drivers)]
        return [
            StoryPhase(drivers[a], a / self._fps, b / self._fps)
            for a, b in itertools.pairwise(bounds)
        ]

    def spheres(self) -> list[MovingSphere]:
        """The balls, from launch to the end of their simulation."""
        balls = []
        for number, hit in enumerate(self._hits, 1):
            if hit.trace is None or hit.trace.impactor is None:
                continue
            track = np.full((len(self.poses), 3), np.nan)
            positions = hit.trace.impactor[:, :3]
            first = hit.start - 1
            stop = min(first + len(positions), len(track))
            track[max(first, 0) : stop] = positions[max(-first, 0) : stop - first]
            balls.append(MovingSphere(f"ball {number}", hit.setup.impact.radius, track))
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
