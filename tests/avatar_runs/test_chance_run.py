from pathlib import Path

import numpy as np
import pytest

from dynresp.avatar_runs.avatar_run import FILES
from dynresp.avatar_runs.chance_run import chance_run
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character


@pytest.mark.slow
def test_the_same_seed_gives_the_same_walk(graph: MotionGraph, character: Character) -> None:
    one, again, other = (chance_run(graph, character, 4.0, seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.motion.poses, again.motion.poses)
    assert not np.array_equal(one.motion.poses, other.motion.poses)
    assert one.motion.duration == pytest.approx(4.0)


def test_the_result_folder(graph: MotionGraph, character: Character, tmp_path: Path) -> None:
    content = chance_run(graph, character, 2.0).save(str(tmp_path / "walk"), video=False)
    assert set(content["files"]) == set(FILES) - {"video.mp4"}
    assert set(content["files"].values()) == {"written"}
    assert {path.name for path in (tmp_path / "walk").iterdir()} == {
        "result.json",
        *content["files"],
    }
