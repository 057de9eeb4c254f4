"""A walk by choice: every few seconds the user picks one of a few actions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.avatar_runs.avatar_run import AvatarRun
from dynresp.avatar_runs.world_setup import play_in_world, refuse_terrain
from dynresp.locomotion.choice.actions import OfferedAction, offer_actions
from dynresp.locomotion.choice.choice_control import ChoiceControl
from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import wrapped
from dynresp.locomotion.playing.blending import Playback
from dynresp.motion.character import Character
from dynresp.results.result_folder import OPTIONS
from dynresp.support.errors import UsageError

# Without a pick the avatar walks on for this long [s] before the next pick.
_UNPICKED_S = 2.0
# An action that ends nearer than this to its start [m] stays in place; if its path is longer than
# the second number [m], it comes back.
_STAYS_M, _COMES_BACK_M = 0.3, 1.5
# Smaller turns are not mentioned [deg].
_MIN_TURN_DEG = 20.0

Pick = Callable[[float, Sequence[str]], int | None]
"""Called with the time [s] and the actions in words; returns the index of one, or None for chance.

It raises `EndOfChoices` to end the walk.
"""


class EndOfChoices(Exception):  # noqa: N818
    """Raised by a `Pick`: the walk ends here."""


def given_answers(answers: Iterable[int | None]) -> Pick:
    """A `Pick` that gives answers from a list, and ends the walk after the last.

    Args:
        answers: Indices of actions, from 0; None leaves one to chance.

    Raises:
        UsageError: (from the `Pick`) There is no action of that index.
    """
    remaining = iter(answers)

    def pick(time_s: float, actions: Sequence[str]) -> int | None:
        try:
            answer = next(remaining)
        except StopIteration:
            raise EndOfChoices from None
        if answer is not None and not 0 <= answer < len(actions):
            raise UsageError(
                f"at {time_s:.1f} s {len(actions)} actions are offered; expected an index from 0 "
                f"to {len(actions) - 1}, or None for chance, got {answer!r:.40}"
            )
        return answer

    return pick


def find_forest(graph: MotionGraph, character: Character) -> ClusterForest:
    """Find the clusters of a graph, between which `choice_run` offers actions."""
    return ClusterForest(graph, Clusters.of(graph, character=character))


def choice_run(
    graph: MotionGraph,
    character: Character,
    pick: Pick,
    seconds: float = 20.0,
    seed: int = 0,
    fps: float = 30.0,
    forest: ClusterForest | None = None,
) -> AvatarRun:
    """Walk by choice.

    Args:
        graph: The motion graph; not one of rough terrain.
        character: The avatar's body.
        pick: Picks each action: `given_answers`, or a function of your own.
        seconds: How long it walks [s]; the last action is played to its end.
        seed: Seed of where it begins, and of what it does without a pick.
        fps: Frame rate of the motion [1/s].
        forest: Clusters of the graph, to find them once for several runs; None to find them here.

    Returns:
        The run. Its result folder has also options.png, the actions that were offered last.

    Raises:
        UsageError: The graph is one of rough terrain.

    Example:
        >>> import dynresp
        >>> from dynresp.motion.character import default_character
        >>> graph = dynresp.build_graph("builtin")
        >>> run = choice_run(graph, default_character(), given_answers([1, None, 0]))
        >>> [moment["picked"] for moment in run.about["choices"]]
        [1, None, 0]
        >>> content = run.save("choices", video=False)
    """
    refuse_terrain(graph)
    forest = forest or find_forest(graph, character)
    rng = np.random.default_rng(seed)
    start = int(rng.choice(graph.frames))
    control, playback = ChoiceControl(graph, start, rng), Playback(graph, start)
    parts = [np.array([start], dtype=np.int32)]
    moments: list[dict[str, Any]] = []
    offered: tuple[OfferedAction, ...] = ()
    unpicked = max(1, round(_UNPICKED_S * graph.config.fps))
    played = 0
    while played < seconds * graph.config.fps:
        time_s = played / graph.config.fps
        offered = offer_actions(forest, control.frame, playback.placement)
        words = [describe_action(action, graph.config.fps) for action in offered]
        try:
            number = pick(time_s, words)
        except EndOfChoices:
            break
        moments.append({"time_s": time_s, "offered": words, "picked": number})
        count = unpicked
        if number is not None:
            control.take(offered[number])
            count = len(offered[number].frames)
        frames = control.advance(count)
        playback.play(frames)
        parts.append(frames)
        played += len(frames)
    if played == 0:
        parts.append(control.advance(unpicked))
    composition = play_in_world(graph, character, np.concatenate(parts), fps)
    picks = sum(moment["picked"] is not None for moment in moments)
    by_chance = len(moments) - picks

    def options(path: Path) -> None:
        from dynresp.view.action_pictures import write_action_pictures

        write_action_pictures([(action.path, action.pose) for action in offered], words, path)

    return AvatarRun.of(
        composition,
        graph,
        character,
        title="A walk by choice",
        subtitle=f"{picks} actions picked, {by_chance} left to chance, seed {seed}",
        about={"seed": seed, "choices": moments, "clusters": len(forest.clusters)},
        writers={OPTIONS: options} if offered else {},
    )


def describe_action(action: OfferedAction, fps: float) -> str:
    """Where an action leads, how it turns, and how long it lasts, in words."""
    first, last = action.path[0], action.path[-1]
    shift = last[:2] - first[:2]
    distance = float(np.hypot(*shift))
    turn = float(np.degrees(wrapped(last[3] - first[3])))
    bearing = float(np.degrees(wrapped(np.arctan2(shift[1], shift[0]) - first[3])))
    length = float(np.hypot(*np.diff(action.path[:, :2], axis=0).T).sum())
    if distance >= _STAYS_M:
        where = f"goes {distance:.1f} m {_direction(bearing)}"
    else:
        where = "stays" if length < _COMES_BACK_M else f"goes {length:.1f} m and comes back"
    turned = "" if abs(turn) < _MIN_TURN_DEG else f", turns {abs(turn):.0f} deg {_side(turn)}"
    return f"{where}{turned}, in {len(action.frames) / fps:.1f} s"


def _side(angle: float) -> str:
    return "left" if angle > 0 else "right"


def _direction(bearing: float) -> str:
    """A bearing from where the avatar faces [deg], in words."""
    if abs(bearing) <= 22.5:
        return "ahead"
    if abs(bearing) >= 157.5:
        return "back"
    corner = {1: "ahead and to the ", 2: "to the ", 3: "back and to the "}
    return corner[round(abs(bearing) / 45.0)] + _side(bearing)
