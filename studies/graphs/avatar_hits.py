"""Avatars that are hit again and again while they walk: how many walk on, and how smoothly."""

from __future__ import annotations

import functools
import math
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dynresp.locomotion.avatar.avatar import Activity, Avatar, RandomPlanner
from dynresp.locomotion.avatar.avatar_crowd import AvatarCrowd
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import IDENTITY
from dynresp.motion.character import ROOT, Character
from dynresp.motion.reactions.reaction_library import ReactionLibrary, default_library
from dynresp.motion.rotations import FloatArray
from dynresp.motion.sources.motion_folders import motion_folders
from dynresp.physics.impacts import Ball, Impact, Punch, Push
from dynresp.response.response import CARRY_ON, ResponseConfig
from dynresp.support.arrays import BoolArray
from studies.graphs.graph_study import FLAT, of_graphs
from studies.study import Columns, Options, Study, Target, Value

# About how many times each avatar is hit; an avatar remembers more returns than that.
_HITS_EACH = 30
# Time from one hit of an avatar to the next, and from the last hit to the end [s].
_BETWEEN_S, _REST_S = (2.0, 5.0), 8.0
# An avatar whose root moves less than this in the last seconds stands still [m].
_MOVED_M, _LAST_S = 0.05, 3.0
_TARGETS = ("chest", "head", "pelvis", "left_thigh", "right_upper_arm")


def measure(
    graph: MotionGraph,
    character: Character,
    count: int,
    seed: int,
    folders: Sequence[Path] | None = None,
) -> dict[str, Value]:
    """Hit avatars on random walks; reactions are those of the default library.

    Args:
        graph: The graph.
        character: The character.
        count: Hits, of all avatars together.
        seed: Of walks and hits.
        folders: Motions folders of the reactions; None for those of `motion_folders`.
    """
    response = ResponseConfig()
    fps = response.physics.fps
    library = default_library(folders, character, fps)
    avatars = math.ceil(count / _HITS_EACH)
    rngs = [np.random.default_rng([seed, k]) for k in range(avatars)]
    crowd = AvatarCrowd(
        character, library, graph, [RandomPlanner(graph, rng) for rng in rngs],
        [(int(rng.choice(graph.frames)), IDENTITY) for rng in rngs], response=response,
    )  # fmt: skip
    start = time.perf_counter()
    roots, hit, broken = _hit(crowd, count, np.random.default_rng(seed), fps)
    seconds = time.perf_counter() - start
    simulated_s = len(roots) * avatars / fps
    outcomes = Counter(what for avatar in crowd.avatars for what in _outcomes(avatar))
    entered = outcomes["carried on"] + outcomes["reacted"]
    last = np.ptp(roots[-round(_LAST_S * fps) :, :, :2], axis=0).max(axis=1)
    walking = np.array([avatar.activity is Activity.WALKING for avatar in crowd.avatars])
    staying = np.array([avatar.activity is Activity.STAYING for avatar in crowd.avatars])
    return {
        "library": library.name,
        "avatars": avatars,
        "hits_thrown": count,
        "frames_not_finite": broken,
        "answered": entered + outcomes["stayed"],
        "carried_on": outcomes["carried on"],
        "reacted": outcomes["reacted"],
        "stayed_down": outcomes["stayed"],
        "walked_on": entered / max(entered + outcomes["stayed"], 1),
        "walking_at_the_end": float(np.mean(walking)),
        "moving_at_the_end": float(np.mean(last[walking] > _MOVED_M)) if walking.any() else 0.0,
        "stuck": int(np.count_nonzero(~walking & ~staying)),
        **_returns(crowd, graph, library, roots, hit, fps),
        "simulated_per_s": simulated_s / seconds,
    }


def some_impact(rng: np.random.Generator) -> Impact:
    """A random ball, push or punch, within the strengths that responders are made for."""
    from_deg = float(rng.uniform(0.0, 360.0))
    kind = rng.integers(3)
    if kind == 0:
        speed, mass = float(rng.uniform(4.0, 14.0)), float(rng.uniform(1.0, 8.0))
        target = str(rng.choice(_TARGETS))
        return Ball(0.4, speed=speed, mass=mass, target=target, from_deg=from_deg)
    if kind == 1:
        force, duration = float(rng.uniform(100.0, 1200.0)), float(rng.uniform(0.1, 0.4))
        return Push(0.1, force, duration, from_deg=from_deg)
    return Punch(0.4, speed=float(rng.uniform(5.0, 11.0)), from_deg=from_deg)


def _hit(
    crowd: AvatarCrowd, count: int, rng: np.random.Generator, fps: float
) -> tuple[FloatArray, BoolArray, int]:
    """Hit avatars until there were enough hits, then let all end.

    Returns:
        (frames, avatars, 3) roots, (frames, avatars) whether each reacts to a hit, and the
        number of poses that are not finite.
    """
    least, most = round(_BETWEEN_S[0] * fps), round(_BETWEEN_S[1] * fps)
    due = rng.integers(round(fps), most, len(crowd.avatars))
    roots: list[FloatArray] = []
    hit: list[list[bool]] = []
    broken, done, rest, frame = 0, 0, round(_REST_S * fps), 0
    while rest > 0:
        for k, avatar in enumerate(crowd.avatars):
            if done < count and frame >= due[k] and avatar.activity is not Activity.HIT:
                avatar.responder.hit(some_impact(rng))
                due[k] = frame + rng.integers(least, most)
                done += 1
        shown = crowd.advance()
        broken += int(np.count_nonzero(~np.isfinite(shown).all(axis=1)))
        roots.append(shown[:, ROOT].copy())
        hit.append([avatar.activity is Activity.HIT for avatar in crowd.avatars])
        frame += 1
        rest -= done >= count
    return np.array(roots), np.array(hit), broken


def _outcomes(avatar: Avatar) -> list[str]:
    """What the avatar did after each hit: stayed, carried on or reacted."""
    return [
        "stayed"
        if back.moment is None
        else "carried on"
        if back.reaction == CARRY_ON
        else "reacted"
        for back in avatar.returns
    ]


def _returns(
    crowd: AvatarCrowd,
    graph: MotionGraph,
    library: ReactionLibrary,
    roots: FloatArray,
    hit: BoolArray,
    fps: float,
) -> dict[str, Value]:
    """Times until the graph is entered again, and steps of the root there."""
    usual = max(
        float(np.percentile(np.linalg.norm(graph.database.velocities[:, :3], axis=1), 99.9)) / fps,
        max(float(np.percentile(_steps(r.motion.poses[:, ROOT]), 99.9)) for r in library.reactions),
    )
    waits, largest_steps = [], []
    for k, avatar in enumerate(crowd.avatars):
        steps = _steps(roots[:, k])
        free = ~(hit[1:, k] | hit[:-1, k])
        for back in avatar.returns:
            if back.moment is not None:
                waits.append((back.moment - back.decided) / fps)
                # The first frame that is shown is frame 1 of the clock.
                second = slice(max(back.moment - 1, 0), back.moment - 1 + round(fps))
                largest_steps.append(float(steps[second][free[second]].max(initial=0.0)))
    if not waits:
        return {}
    return {
        "back_after_median_s": float(np.median(waits)),
        "back_after_largest_s": max(waits),
        "root_step_recorded_p99.9_m": usual,
        "root_step_entering_p99_m": float(np.percentile(largest_steps, 99.0)),
        "root_step_entering_largest_m": max(largest_steps),
    }


def _steps(track: FloatArray) -> FloatArray:
    """(n - 1,) distances from each position (n, 3) to the next [m]."""
    steps: FloatArray = np.linalg.norm(np.diff(track, axis=0), axis=1)
    return steps


def _measured(options: Options) -> Columns:
    """Measure with the reactions in the motions folders that the options name."""
    with_folders = functools.partial(measure, folders=motion_folders(options.motions))
    return of_graphs(with_folders, FLAT, 2000, 6)(options)


STUDY = Study(
    "avatar-hits",
    "avatars that are hit again and again while they walk: how many walk on, and how smoothly",
    "10 min",
    _measured,
    (
        Target("walked_on", "all", at_least=1.0),
        Target("stuck", "0", at_most=0),
        Target("frames_not_finite", "0", at_most=0),
    ),
    notes=(
        "Balls, pushes and punches at avatars on random walks, 2 to 5 s after each other; "
        "walked_on is the share of the answers after which the graph was entered again.",
        "root_step: how far the root moves from one frame to the next in the second after the "
        "graph is entered.",
    ),
)
