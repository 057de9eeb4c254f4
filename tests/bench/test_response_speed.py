"""The benchmark from a hit to a plan, and the one of labelled samples."""

import pytest

from dynresp.bench import generation_speed as generate
from dynresp.bench import response_speed as respond
from dynresp.response.budget import BUDGETS


@pytest.fixture(autouse=True)
def _no_motions(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """On what the product makes itself, wherever the tests run."""
    monkeypatch.delenv("DYNRESP_MOTIONS", raising=False)
    monkeypatch.setenv("DYNRESP_CACHE", str(tmp_path_factory.mktemp("cache")))


@pytest.mark.slow
def test_every_budget_and_stage_is_timed() -> None:
    result = respond.run(hits=6)
    assert result.more["library"] == "builtin"
    assert 0.0 < result.value < 1000.0
    for budget in BUDGETS:
        for name in (f"{budget}_ms", f"{budget}_p95_ms", f"{budget}_second_pass_ms"):
            assert float(result.more[name]) > 0.0
    stages = {name for name in result.more if name.startswith("stage_")}
    assert {"stage_physics_ms", "stage_features_ms", "stage_align_ms"} <= stages
    assert sum(float(result.more[name]) for name in ("stage_features_ms", "stage_align_ms")) < 50.0


@pytest.mark.slow
def test_samples_are_timed_against_a_loop_that_agrees() -> None:
    result = generate.run(samples=40, looped=5)
    assert result.more["samples"] == 40
    assert 1 <= int(result.more["hits"]) <= 40
    assert result.ratio > 0.0
