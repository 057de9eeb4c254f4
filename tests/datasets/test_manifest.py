import copy
import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynresp.datasets.manifest import MANIFEST, differences, identity_of, write_manifest
from dynresp.datasets.manifest_reader import ManifestError, parse_facts, read_manifest
from dynresp.datasets.sample_worker import SampleWorker
from dynresp.response.search.hit_labels import OUTCOMES
from dynresp.support.errors import UsageError

from .samples import plan


@pytest.fixture(scope="module")
def manifest(sample_worker: SampleWorker) -> dict[str, Any]:
    return sample_worker.manifest(8)


def test_it_says_what_the_numbers_mean(manifest: dict[str, Any]) -> None:
    facts = parse_facts(manifest)
    assert (facts.count, facts.shard_size, facts.seed) == (20, 8, 5)
    assert facts.bases == ("builtin:walk", "builtin:idle")
    assert facts.kinds == ("ball", "punch", "push")
    assert facts.outcomes == OUTCOMES
    assert facts.classes[-1] == "carry_on"
    assert len(facts.classes) == len(facts.strategies) == len(facts.mirrors) == 25
    assert facts.strategies[facts.classes.index("side_fall_mirrored")] == "side_fall"
    for number, mirror in enumerate(facts.mirrors):
        assert facts.mirrors[mirror] == number
        assert facts.strategies[mirror] == facts.strategies[number]
    assert facts.mirrors[-1] == 24
    assert facts.fps == 30.0
    assert facts.settings["window_s"] == pytest.approx(1 / 3)
    assert set(facts.versions) == {"dynresp", "mujoco", "numpy", "numba"}


def test_it_is_written_and_read(manifest: dict[str, Any], tmp_path: Path) -> None:
    write_manifest(manifest, tmp_path)
    assert read_manifest(tmp_path) == manifest
    assert [path.name for path in tmp_path.iterdir()] == [MANIFEST]


def test_count_and_name_do_not_decide(
    manifest: dict[str, Any], sample_worker: SampleWorker
) -> None:
    other = copy.deepcopy(manifest)
    other["count"] = other["plan"]["plan"]["count"] = 99
    other["plan"]["plan"]["name"] = "another"
    assert differences(manifest, other) == []
    assert identity_of(other) == manifest["identity"]


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("plan.plan.seed", 6),
        ("plan.impact 1.mass_kg.uniform 1", 2.0),
        ("plan.base 2.weight", 3.0),
        ("plan.library.which", "core"),
        ("library.identity", "0"),
        ("character.identity", "0"),
        ("bases 1.poses_sha256", "0"),
        ("settings.window_s", 1.0),
        ("versions.mujoco", "3.18.0"),
        ("shard_size", 9),
        ("features", ["one"]),
    ],
)
def test_what_decides_is_told(manifest: dict[str, Any], place: str, value: Any) -> None:
    other = copy.deepcopy(manifest)
    within: Any = other
    *path, last = [key for part in place.split(".") for key in part.split(" ")]
    for key in path:
        within = within[int(key) - 1] if key.isdigit() else within[key]
    within[int(last) - 1 if last.isdigit() else last] = value
    assert differences(manifest, other) == [place]
    assert identity_of(other) != manifest["identity"]


def test_a_folder_without_one_is_no_dataset(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "none"):
        with pytest.raises(UsageError, match=r"holds no dataset \(no manifest\.json\)"):
            read_manifest(folder)


def test_another_schema_is_refused(manifest: dict[str, Any], tmp_path: Path) -> None:
    write_manifest({**manifest, "schema_version": 2}, tmp_path)
    with pytest.raises(UsageError, match="schema version 2; this dynresp reads 1"):
        read_manifest(tmp_path)


@pytest.mark.parametrize("junk", [b"", b"[]", b"{}", b"\xff", b"[" * 100_000, b'{"format": 3}'])
def test_junk_is_refused(tmp_path: Path, junk: bytes) -> None:
    (tmp_path / MANIFEST).write_bytes(junk)
    with pytest.raises(ManifestError, match=rf"{MANIFEST}: damaged"):
        read_manifest(tmp_path)


def _places(value: Any, place: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    found = [place] if place else []
    if isinstance(value, dict):
        for key, item in value.items():
            found += _places(item, (*place, key))
    elif isinstance(value, list):
        for number, item in enumerate(value[:3]):
            found += _places(item, (*place, number))
    return found


@pytest.mark.slow
@given(data=st.data())
def test_whatever_a_manifest_says_it_is_parsed_or_refused(
    data: st.DataObject, manifest: dict[str, Any]
) -> None:
    """Also where somebody made its identity fit."""
    other = copy.deepcopy(manifest)
    place = data.draw(st.sampled_from(_places(other)))
    junk = st.one_of(
        st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5),
        st.lists(st.integers(), max_size=2), st.dictionaries(st.text(max_size=3), st.integers()),
    )  # fmt: skip
    within: Any = other
    for key in place[:-1]:
        within = within[key]
    if data.draw(st.booleans()):
        within[place[-1]] = data.draw(junk)
    else:
        del within[place[-1]]
    for forged in (False, True):
        if forged:
            try:
                other["identity"] = identity_of(other)
            except (KeyError, TypeError, ValueError, AttributeError):
                return
        with suppress(ManifestError):
            facts = parse_facts(json.loads(json.dumps(other)), "file")
            assert facts.count >= 1
            assert len(facts.layout) > 20


def test_a_world_is_the_same_each_time(manifest: dict[str, Any], tmp_path: Path) -> None:
    assert SampleWorker(plan(), tmp_path, tmp_path).manifest(8) == manifest
