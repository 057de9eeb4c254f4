import json

import numpy as np
import pytest

from dynresp.response.windows.windows import ReactionTrack, library_windows, make_windows
from dynresp.support.errors import DynrespError
from studies.benchmarks import full_search_speed as oracle


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """A trace and two reactions, small enough to be measured in a moment."""
    monkeypatch.setattr(oracle, "_ROUNDS", 2)
    rng = np.random.default_rng(0)
    rest = rng.normal(scale=0.2, size=(14, 3))
    last = oracle.SIZE.exit_frames[-1] + oracle.SIZE.window_frames
    trace = oracle.synthetic_track(rng, rest, last)
    reactions = [
        ReactionTrack(name, *oracle.synthetic_track(rng, rest, 20)) for name in ("one", "two")
    ]
    return {"trace": trace, "reactions": reactions}


def test_the_report_is_whole(small: dict[str, object]) -> None:
    result = oracle.run(**small)  # type: ignore[arg-type]
    content = json.loads(json.dumps(result.to_json()))
    for key in ("name", "value", "unit", "baseline", "ratio", "ratio_twin", "machine"):
        assert key in content
    assert content["value"] > 0.0
    assert content["ratio"] == pytest.approx(content["baseline"] / content["value"])


def test_times_are_refused_where_the_sides_disagree(
    small: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    right = oracle.NumpySurface.__call__
    monkeypatch.setattr(
        oracle.NumpySurface, "__call__", lambda self, operands: right(self, operands) * 1.01
    )
    with pytest.raises(DynrespError, match="differ"):
        oracle.run(**small)  # type: ignore[arg-type]


def test_the_baseline_is_the_window_error(small: dict[str, object]) -> None:
    """Vectorised NumPy gives the very numbers that the kernel gives."""
    from dynresp.response.search.full_search import search

    config = oracle.SIZE
    trace = make_windows(*small["trace"], config.exit_frames, config)  # type: ignore[misc]
    library = library_windows(small["reactions"], config)  # type: ignore[arg-type]
    baseline = oracle.NumpySurface(trace)
    found = search(trace, library)
    for name, windows in zip(library.names, library.windows, strict=True):
        surface = baseline(baseline.prepare(windows))
        np.testing.assert_allclose(found.surface(name).errors, surface, rtol=1e-4, atol=2e-5)
