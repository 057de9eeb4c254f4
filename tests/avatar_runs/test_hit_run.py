"""A walk with balls thrown at it, told by what moved the avatar."""

from dataclasses import replace

from dynresp.avatar_runs.avatar_run import figures, skate
from dynresp.avatar_runs.hit_run import hit_outing
from dynresp.motion.character import Character
from tests.locomotion.samples import walking_graph


def test_feet_are_told_by_what_moved_the_avatar(character: Character) -> None:
    graph = walking_graph(character)
    outing = hit_outing(graph, character, [], 9.0, 3, lambda stage, done, of: None)
    parts = outing.about["foot_skate_by_part_m"]
    assert {"graph", "approach", "physics", "blend"} <= set(parts)
    # Nobody stands in this small graph: a foot is dragged once by who walks off at once.
    assert parts["graph"]["median"] < 1e-3
    assert all(part["worst"] >= part["median"] >= 0.0 for part in parts.values())
    # Parts of stances are no longer than whole ones.
    whole = skate(outing.motion, character)
    assert whole is not None
    assert whole["worst"] >= max(part["worst"] for part in parts.values()) - 1e-9
    slow = replace(outing, motion=outing.motion.resampled(1.0))
    assert figures(slow, character)["foot_skate_m"] is None
