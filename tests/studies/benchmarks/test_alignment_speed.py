import json

import numpy as np
import pytest

from dynresp.response.alignment.alignment import Aligner, AlignmentConfig
from dynresp.response.windows.windows import ReactionTrack, WindowErrorConfig
from dynresp.support.errors import DynrespError
from studies.benchmarks import alignment_speed as align
from studies.benchmarks.full_search_speed import synthetic_track


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> align.Cases:
    """Three traces and two reactions, small enough to be measured in a moment."""
    monkeypatch.setattr(align, "_ROUNDS", 2)
    rng = np.random.default_rng(0)
    rest = rng.normal(scale=0.2, size=(14, 3))
    window = WindowErrorConfig(fps=30.0, exit_min_s=1 / 6)
    traces = [synthetic_track(rng, rest, 25) for _ in range(3)]
    positions, quaternions = (np.stack(part) for part in zip(*traces, strict=True))
    tracks = [ReactionTrack(name, *synthetic_track(rng, rest, 25)) for name in ("one", "two")]
    return align.Cases(positions, quaternions, tracks, window, "made in the test")


def test_the_report_is_whole(small: align.Cases) -> None:
    result = align.run(cases=small, config=AlignmentConfig(sets_without_gain=9, starts=2))
    content = json.loads(json.dumps(result.to_json()))
    for key in ("name", "value", "unit", "baseline", "ratio", "machine", "batch"):
        assert key in content
    assert content["ratio"] == pytest.approx(content["baseline"] / content["value"])
    assert content["pairs_exhaustive"] == 11 * 16
    assert content["evaluations"] > 5 * 7
    assert content["sets"] == 5
    assert 0.0 <= content["within_2_percent"] <= 1.0
    assert "made in the test" in result.to_text()


def test_times_are_refused_where_the_sides_disagree(
    small: align.Cases, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = Aligner.errors
    monkeypatch.setattr(Aligner, "errors", lambda self, *given: right(self, *given) * 1.01)
    with pytest.raises(DynrespError, match="the aligner finds an error"):
        align.run(cases=small)


def test_it_throws_balls(monkeypatch: pytest.MonkeyPatch) -> None:
    """On motion capture where there is some, else on what the product makes itself."""
    monkeypatch.setattr(align, "_ROUNDS", 1)
    monkeypatch.setattr(align, "HITS", 6)
    content = align.run(3).to_json()
    assert content["name"] == "align"
    assert content["seed"] == 3
    assert 0 < content["hits"] <= 6  # type: ignore[operator]
