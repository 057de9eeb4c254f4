"""The benchmark of motion graphs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.pruning import Jumps, find_jumps
from dynresp.motion import rotations
from dynresp.support.errors import DynrespError
from studies.benchmarks import graph_speed as bench
from studies.benchmarks.graph_database import database_of
from studies.benchmarks.numpy_pruning_twin import NumpyPruning
from tests.locomotion.graph.graph_samples import made_database


@pytest.fixture(autouse=True)
def small(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Little to walk, on what the product makes itself, wherever the tests run."""
    for name, value in {"WALKED": 3000, "PLAYED": 2000, "FITTED": 200, "_ROUNDS": 1}.items():
        monkeypatch.setattr(bench, name, value)
    monkeypatch.delenv("DYNRESP_MOTIONS", raising=False)
    monkeypatch.setenv("DYNRESP_CACHE", str(tmp_path_factory.mktemp("cache")))


@pytest.mark.slow
def test_the_report_is_whole() -> None:
    result = bench.run(frames=700, sizes=(500,))
    content = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert content["ratio"] == pytest.approx(content["baseline"] / content["value"])
    assert content["motions"] == "builtin"
    assert content["pairs"] == 700**2
    assert 0 <= content["repeated_frames"] < 700
    assert 0 < content["component_frames"] <= 700
    assert 0.0 < content["numpy_part"] < 1.0
    left = [content[f"left_by_{rule}"] for rule in ("contact", "likelihood", "similarity")]
    assert left == sorted(left, reverse=True)
    for name in ("one_thread_s", "strict_s", "walk_per_s", "played_per_s", "fitted_per_s",
                 "file_mib", "save_s", "load_s", "loose_500_s", "strict_500_jumps"):  # fmt: skip
        assert content[name] > 0
    if Path("/proc/self/status").exists():
        assert 0.0 <= content["memory_added_mib"] < content["peak_memory_mib"] < 1024.0
    assert "built-in motion and no motion capture" in result.to_text()


@pytest.mark.parametrize("coordinates", list(Coordinates))
@pytest.mark.parametrize("contact_change", [True, False])
@pytest.mark.parametrize("seed", [1, 2])
def test_numpy_finds_what_is_found(
    coordinates: Coordinates, contact_change: bool, seed: int
) -> None:
    database = made_database(np.random.default_rng(seed), (150, 1, 2, 141), alike=0.1)
    config = GraphConfig(coordinates=coordinates, contact_change=contact_change, sigma=0.4)
    twin = NumpyPruning.of(database, config)
    jumps = set()
    for start in range(0, len(database), 67):
        block = twin.block(start, min(start + 67, len(database)))
        first, second = np.nonzero(twin.jumps(block))
        jumps |= set(zip((first + start).tolist(), second.tolist(), strict=True))
    found = find_jumps(database, config)
    pairs = zip(found.sources.tolist(), (found.targets - 1).tolist(), strict=True)
    expected = {(i, j) for i, j in pairs if i < j}
    assert len(expected) > 10
    assert jumps == expected


def test_times_are_refused_where_the_sides_disagree(monkeypatch: pytest.MonkeyPatch) -> None:
    database = made_database(np.random.default_rng(3), (120, 110), alike=0.02)
    twin = NumpyPruning.of(database, bench.LOOSE)
    blocks = [twin.block(20, 70)]
    found = find_jumps(database, bench.LOOSE)
    bench._check_agreement(database, twin, blocks)
    inside = (found.sources >= 20) & (found.sources < 70) & (found.targets > found.sources + 1)
    for change in (np.flatnonzero(inside)[:1], np.flatnonzero(inside)[-1:]):
        keep = np.ones(len(found.sources), dtype=bool)
        keep[change] = False
        fewer = replace(
            found,
            sources=found.sources[keep],
            targets=found.targets[keep],
            distances=found.distances[keep],
        )
        refused(monkeypatch, fewer, database, twin, blocks)
    # One that is too far away.
    more = replace(found, targets=np.where(np.cumsum(inside) == 1, 200, found.targets))
    refused(monkeypatch, more, database, twin, blocks)


def refused(monkeypatch: pytest.MonkeyPatch, changed: Jumps, *checked: object) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(bench, "find_jumps", lambda *_: changed)
        with pytest.raises(DynrespError, match="NumPy finds other jumps"):
            bench._check_agreement(*checked)  # type: ignore[arg-type]


class TestDatabase:
    def test_it_begins_with_what_was_recorded(self) -> None:
        recorded = made_database(np.random.default_rng(3), (30, 20, 25))
        made = database_of(recorded, 41, np.random.default_rng(0))
        np.testing.assert_array_equal(made.poses, recorded.poses[:41])
        np.testing.assert_array_equal(made.contacts, recorded.contacts[:41])
        assert [(clip.start, clip.stop) for clip in made.clips] == [(0, 30), (30, 41)]

    def test_then_clips_come_again_a_little_otherwise(self) -> None:
        recorded = made_database(np.random.default_rng(3), (30, 20))
        made = database_of(recorded, 115, np.random.default_rng(0))
        assert [clip.stop for clip in made.clips] == [30, 50, 80, 100, 115]
        assert len({clip.identity for clip in made.clips}) == 5
        np.testing.assert_array_equal(made.poses[:50], recorded.poses)
        np.testing.assert_array_equal(made.poses[50:100, :3], recorded.poses[:, :3])
        turns = rotations.angle_between(
            *(x[:, 3:].reshape(-1, 14, 4) for x in (made.poses[50:100], recorded.poses))
        )
        assert 0.02 < np.median(turns) < 0.5
        # Slowly: from frame to frame they hardly change.
        assert np.abs(np.diff(turns[:30], axis=0)).max() < 0.2
        same = database_of(recorded, 115, np.random.default_rng(0))
        np.testing.assert_array_equal(same.poses, made.poses)
