"""Avatars that are hit again and again while they walk: none is stuck, nothing leaps."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from dynresp.locomotion.avatar.avatar import Activity
from dynresp.locomotion.graph.graph_config import GraphConfig
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.reactions.reaction_library import BUILTIN, ReactionLibrary, load_library
from dynresp.physics.impacts import Ball, Impact, Punch, Push
from tests.locomotion.avatar.avatar_samples import Watched, root_steps
from tests.locomotion.samples import walking_graph

FPS = 30.0


def _random_impact(rng: np.random.Generator) -> Impact:
    where = {"from_deg": float(rng.uniform(0.0, 360.0))}
    kind = rng.integers(3)
    if kind == 0:
        target = str(rng.choice(["chest", "head", "pelvis", "left_thigh", "right_upper_arm"]))
        speed, mass = float(rng.uniform(4.0, 14.0)), float(rng.uniform(1.0, 8.0))
        return Ball(0.4, speed=speed, mass=mass, target=target, **where)
    if kind == 1:
        return Push(0.1, float(rng.uniform(100.0, 1200.0)), float(rng.uniform(0.1, 0.4)), **where)
    return Punch(0.4, speed=float(rng.uniform(5.0, 11.0)), **where)


def _hit_again_and_again(crowd: Watched, rng: np.random.Generator, hits: int, rest: int) -> int:
    """Hit avatars that walk or lie, two to six seconds after each other; then let all end.

    Returns:
        How many hits there were.
    """
    due = rng.integers(20, 120, len(crowd.avatars))
    done, frame = 0, 0
    while done < hits:
        for i, avatar in enumerate(crowd.avatars):
            if frame >= due[i] and avatar.activity is not Activity.HIT:
                avatar.responder.hit(_random_impact(rng))
                due[i] = frame + rng.integers(60, 150)
                done += 1
        crowd.go_on(1)
        frame += 1
    crowd.go_on(rest)
    return done


def _check_all_came_back(
    crowd: Watched,
    graph: MotionGraph,
    library: ReactionLibrary,
    within_s: float,
    longest_step: float,
) -> Counter[str]:
    """Nobody is stuck, nothing leaps; what became of the hits is counted."""
    walked = np.linalg.norm(graph.database.velocities[:, :3], axis=1) / FPS
    reacted = [root_steps(reaction.motion.poses) for reaction in library.reactions]
    usual = max(np.quantile(walked, 0.999), np.quantile(np.concatenate(reacted), 0.999))
    outcomes: Counter[str] = Counter()
    paths: list[float] = []
    for i, avatar in enumerate(crowd.avatars):
        shown, doing = crowd.shown(i), crowd.activity(i)
        assert np.isfinite(shown).all()
        steps = root_steps(shown)
        assert steps.max() < longest_step
        hit = np.array([what is Activity.HIT for what in doing])
        free = ~(hit[1:] | hit[:-1])
        for back in avatar.returns:
            if back.moment is None:
                outcomes["stays"] += 1
                continue
            outcomes["carried on" if back.reaction == "carry_on" else "reacted"] += 1
            assert (back.moment - back.decided) / FPS < within_s
            window = slice(back.moment, back.moment + 30)
            assert steps[window][free[window]].max(initial=0.0) < usual + 0.03
        # By the end all are what they are to be: walking, or down where a reaction has ended so.
        assert doing[-1] in (Activity.WALKING, Activity.STAYING)
        if doing[-1] is Activity.STAYING:
            assert avatar.returns[-1].moment is None
        else:
            paths.append(root_steps(shown[-90:]).sum())
            assert paths[-1] > 0.05
            assert avatar.responder.planned_until > avatar.responder.frame + 90
    # In their last three seconds most walk on, and do not just step about.
    assert np.median(paths) > 1.0
    return outcomes


@pytest.mark.slow
def test_hundreds_of_hits_on_built_in_walkers(character: Character) -> None:
    graph = walking_graph(character)
    library = load_library(BUILTIN, character=character)
    crowd = Watched(character, library, graph, list(range(40)), threads=2)
    done = _hit_again_and_again(crowd, np.random.default_rng(8), 200, 240)
    outcomes = _check_all_came_back(crowd, graph, library, 5.0, 0.15)
    assert done == 200
    assert outcomes["reacted"] > 30
    # The built-in fall to the side ends lying; nobody stays in any other way.
    assert outcomes["stays"] > 0
    for avatar in crowd.avatars:
        falls = [back.reaction for back in avatar.returns if back.moment is None]
        assert all(name.startswith("side_fall") or name == "carry_on" for name in falls)
        assert (avatar.responder.pose[2] < 0.4) == (avatar.activity is Activity.STAYING)


@pytest.mark.slow
@pytest.mark.mocap
def test_thousands_of_hits_on_recorded_walkers(character: Character, motions_folder: Path) -> None:
    """2,000 hits, the library of one reaction for each strategy, all of which end on the feet."""
    folder = motions_folder / "snumrl_DataDrivenBipedController"
    options = LoadOptions(trim_t_poses=True)
    motions = [load_motion(path, character, options) for path in sorted(folder.glob("*.bvh"))]
    graph = MotionGraph.build(motions, GraphConfig(), character)
    library = load_library("core", [motions_folder], character)
    crowd = Watched(character, library, graph, list(range(64)), threads=2)
    done = _hit_again_and_again(crowd, np.random.default_rng(9), 2000, 240)
    outcomes = _check_all_came_back(crowd, graph, library, 6.0, 0.25)
    assert done >= 2000
    assert outcomes["stays"] == 0
    assert outcomes["reacted"] > 1000
