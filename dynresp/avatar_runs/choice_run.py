"""An outing by choice: every few seconds somebody picks one of a few actions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dynresp.avatar_runs.avatar_run import Outing
from dynresp.avatar_runs.world_setup import play_in_world
from dynresp.locomotion.choice.actions import OfferedAction, offer_actions
from dynresp.locomotion.choice.choice_control import ChoiceControl
from dynresp.locomotion.clusters.cluster_forest import ClusterForest
from dynresp.locomotion.clusters.frame_clusters import Clusters
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.locomotion.graph.placement import wrapped
from dynresp.locomotion.playing.blending import Playback
from dynresp.motion.character import Character
from dynresp.results.result_folder import OPTIONS

# Without a pick it walks on for so long [s] before it asks again.
_ON_S = 2.0
# Who ends nearer than this to where it began stays, or comes back where the way was longer [m].
_STAYS_M, _AROUND_M = 0.3, 1.5

Pick = Callable[[float, Sequence[str]], int | None]
"""Told the time [s] and the actions in words; answers with the number of one, from 0, or None."""


class Enough(Exception):  # noqa: N818
    """Raised by a `Pick`: no further action is wanted."""


def choice_outing(
    graph: MotionGraph,
    character: Character,
    seconds: float,
    seed: int,
    pick: Pick,
    fps: float,
) -> Outing:
    """Walk by choice.

    Args:
        graph: What is walked through.
        character: Whose body it is.
        seconds: How long; the last action is played to its end.
        seed: Of where it begins, and of what it does unasked.
        pick: Who chooses.
        fps: Frame rate of the motion [1/s].
    """
    forest = ClusterForest(graph, Clusters.of(graph, character=character))
    rng = np.random.default_rng(seed)
    start = int(rng.choice(graph.frames))
    control, playback = ChoiceControl(graph, start, rng), Playback(graph, start)
    parts = [np.array([start], dtype=np.int32)]
    told: list[dict[str, Any]] = []
    offered: tuple[OfferedAction, ...] = ()
    played = 0
    while played < seconds * graph.config.fps:
        at_s = played / graph.config.fps
        offered = offer_actions(forest, control.frame, playback.placement)
        words = [in_words(action, graph.config.fps) for action in offered]
        try:
            number = pick(at_s, words)
        except Enough:
            break
        told.append({"time_s": at_s, "offered": words, "picked": number})
        frames = max(1, round(_ON_S * graph.config.fps))
        if number is not None:
            control.take(offered[number])
            frames = len(offered[number].frames)
        way = control.advance(frames)
        playback.play(way)
        parts.append(way)
        played += len(way)
    if played == 0:
        parts.append(control.advance(max(1, round(_ON_S * graph.config.fps))))
    composition = play_in_world(graph, character, np.concatenate(parts), fps)
    picks = sum(moment["picked"] is not None for moment in told)

    def options(path: Path) -> None:
        from dynresp.view.action_pictures import write_action_pictures

        write_action_pictures([(action.path, action.pose) for action in offered], words, path)

    return Outing.of(
        composition,
        graph,
        title="A walk by choice",
        subtitle=f"{picks} actions picked, {len(told) - picks} times left to chance, seed {seed}",
        about={"seed": seed, "choices": told, "clusters": len(forest.clusters)},
        writers={OPTIONS: options} if offered else {},
    )


def in_words(action: OfferedAction, fps: float) -> str:
    """Where an action leads, how it turns there, and when."""
    first, last = action.path[0], action.path[-1]
    way = last[:2] - first[:2]
    distance = float(np.hypot(*way))
    turn = float(np.degrees(wrapped(last[3] - first[3])))
    bearing = float(np.degrees(wrapped(np.arctan2(way[1], way[0]) - first[3])))
    length = float(np.hypot(*np.diff(action.path[:, :2], axis=0).T).sum())
    if distance >= _STAYS_M:
        where = f"goes {distance:.1f} m {_side(bearing)}"
    else:
        where = "stays" if length < _AROUND_M else f"goes {length:.1f} m and comes back"
    turned = "" if abs(turn) < 20.0 else f", turns {abs(turn):.0f} deg {_hand(turn)}"
    return f"{where}{turned}, in {len(action.frames) / fps:.1f} s"


def _hand(angle: float) -> str:
    return "left" if angle > 0 else "right"


def _side(bearing: float) -> str:
    """A direction in words, from the way one faces."""
    if abs(bearing) <= 22.5:
        return "ahead"
    if abs(bearing) >= 157.5:
        return "back"
    corner = {1: "ahead and to the ", 2: "to the ", 3: "back and to the "}
    return corner[round(abs(bearing) / 45.0)] + _hand(bearing)
