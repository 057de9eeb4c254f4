"""The file of a graph: exact there and back, and refused where it is damaged."""

import json
import random
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynresp.locomotion.graph.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph.graph_file import FORMAT, graph_identity, load_graph, save_graph
from dynresp.locomotion.graph.motion_graph import MotionGraph
from dynresp.motion.character import Character, default_character
from dynresp.support.errors import GraphFileError
from tests.locomotion.samples import walking_graph, walking_motions


@pytest.fixture(scope="module")
def graph() -> MotionGraph:
    return walking_graph(default_character(), sigma=0.3)


@pytest.fixture
def file(graph: MotionGraph, tmp_path: Path) -> Path:
    save_graph(graph, tmp_path / "graph.npz")
    return tmp_path / "graph.npz"


def rewritten(file: Path, **changes: Any) -> Path:
    with np.load(file, allow_pickle=False) as archive:
        arrays = {**dict(archive), **changes}
    np.savez(file, **arrays)
    return file


def reconfigured(file: Path, **changes: Any) -> Path:
    """The file with other values in its configuration; `...` leaves one out."""
    with np.load(file, allow_pickle=False) as archive:
        config = {**json.loads(archive["config"].item()), **changes}
    kept = {name: value for name, value in config.items() if value is not ...}
    return rewritten(file, config=np.array(json.dumps(kept)))


class TestRoundTrip:
    def test_is_exact(self, graph: MotionGraph, file: Path) -> None:
        read = load_graph(file)
        assert read.config == graph.config
        assert read.counts == graph.counts
        assert read.database.clips == graph.database.clips
        for name in ("offsets", "targets", "distances", "probabilities", "placements"):
            np.testing.assert_array_equal(getattr(read, name), getattr(graph, name))
        np.testing.assert_array_equal(read.database.poses, graph.database.poses)
        np.testing.assert_array_equal(read.database.contacts, graph.database.contacts)
        assert graph_identity(read) == graph_identity(graph)

    def test_same_graph_same_bytes(self, graph: MotionGraph, file: Path, tmp_path: Path) -> None:
        save_graph(load_graph(file), tmp_path / "again.npz")
        assert (tmp_path / "again.npz").read_bytes() == file.read_bytes()

    def test_with_hands(self, character: Character, tmp_path: Path) -> None:
        motions = walking_motions(character)
        rng = np.random.default_rng(3)
        touching = [np.hstack([m.contacts, rng.random((len(m), 2)) > 2]) for m in motions]
        config = GraphConfig(sigma=0.5, coordinates=Coordinates.FIXED)
        graph = MotionGraph.build(motions, config, character, touching)
        save_graph(graph, tmp_path / "graph.npz")
        read = load_graph(tmp_path / "graph.npz")
        np.testing.assert_array_equal(read.database.contacts, graph.database.contacts)
        assert read.config.coordinates is Coordinates.FIXED

    def test_a_changed_graph_has_another_identity(
        self, graph: MotionGraph, character: Character
    ) -> None:
        assert graph_identity(graph) != graph_identity(walking_graph(character, sigma=0.31))


class TestRefuses:
    def test_another_character(self, file: Path) -> None:
        rewritten(file, character=np.array("0123"))
        with pytest.raises(GraphFileError, match="graph of character '0123'"):
            load_graph(file)

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            (lambda a: {"distances": a["distances"] + np.float32(0.01)}, "its hash differs"),
            (lambda a: {"distances": a["distances"] - np.float32(9.0)}, "negative or not finite"),
            (lambda a: {"targets": a["targets"] + np.int32(10**6)}, "a frame that does not exist"),
            (lambda a: {"offsets": a["offsets"][::-1].copy()}, "the transitions do not match"),
            (lambda a: {"feet": a["feet"][:-1]}, "contacts are not given"),
            (lambda a: {"clip_stops": a["clip_stops"] - 1}, "cover all"),
            (lambda a: {"clip_names": a["clip_names"][:-1]}, "differ in number"),
            (lambda a: {"config": np.array("[]")}, "the configuration is not a table"),
            (lambda a: {"config": np.array("{}")}, "coordinates"),
            (lambda a: {"config": np.array("{")}, "does not hold a graph"),
            (lambda a: {"config": np.array("[" * 1990)}, "nested too deeply"),
            (lambda a: {"poses": a["poses"] * np.nan}, "not finite"),
            (lambda a: {"poses": a["poses"].astype("<f4")}, "poses must be of type <f8"),
            (lambda a: {"format_version": np.array(9)}, "format version 9"),
        ],
    )
    def test_what_does_not_fit(self, file: Path, change: Any, said: str) -> None:
        with np.load(file, allow_pickle=False) as archive:
            changes = change(dict(archive))
        with pytest.raises(GraphFileError, match=said):
            load_graph(rewritten(file, **changes))

    @pytest.mark.parametrize(
        ("changes", "said"),
        [
            ({"fps": 10**400}, "fps must be from 1 to 240"),
            ({"fps": 10**9}, "fps must be from 1 to 240"),
            ({"fps": "15"}, "fps must be a number, not str"),
            ({"fps": True}, "fps must be a number, not bool"),
            ({"mirrored": "no"}, "mirrored must be true or false, not str"),
            ({"contact_change": 3}, "contact_change must be true or false, not int"),
            ({"local_maxima": 0}, "local_maxima must be true, false or null, not int"),
            ({"coordinates": ["relative"]}, "coordinates must be text, not list"),
            ({"coordinates": "absolute"}, "'absolute' is not a valid Coordinates"),
            ({"blend_s": 1e12}, "blend_s must be from 0.01 to 10"),
            ({"blend_rate_s": 1e-9}, "blend_rate_s must be from 0.01 to 10"),
            ({"sigma": 10**400}, "sigma must be from 1e-09 to 1000"),
            ({"sigma": 1e-9}, "no transition with a probability"),
            ({"sigma": None}, "sigma must be a number, not NoneType"),
            ({"slip_m": float("nan")}, "slip_m must be from 0 to 100 m"),
            ({"stutter_s": float("inf")}, "stutter_s must be from 0 to 10 s"),
            ({"least_probability": "1"}, "least_probability must be a number"),
            ({"sigma": ...}, "configuration must have the keys .*, sigma,"),
            ({"sigmas": 1.0}, "configuration must have the keys .*, sigma,"),
        ],
    )
    def test_configurations_that_make_no_sense(
        self, file: Path, changes: dict[str, Any], said: str
    ) -> None:
        with pytest.raises(GraphFileError, match=f"does not hold a graph: .*{said}"):
            load_graph(reconfigured(file, **changes))

    @pytest.mark.parametrize(
        ("columns", "value", "said"),
        [
            (slice(3, 7), 0.0, "quaternion 0 of frame 5 has the length 0"),
            (slice(3, 7), 500.0, "quaternion 0 of frame 5 has the length 1000"),
            (slice(11, 15), 1e200, "quaternion 2 of frame 5 has the length inf"),
            (slice(11, 15), 0.500001, "quaternion 2 of frame 5 has the length 1"),
            (0, 1e308, "the root of frame 5 is .* within 100000 m"),
            (2, -100_001.0, "the root of frame 5 is .* within 100000 m"),
        ],
    )
    def test_poses_that_no_body_has(
        self, graph: MotionGraph, tmp_path: Path, columns: int | slice, value: float, said: str
    ) -> None:
        poses = np.array(graph.database.poses)
        poses[5, columns] = value
        # Its hash is right, so only the look at the poses can refuse it.
        path = tmp_path / "graph.npz"
        save_graph(replace(graph, database=replace(graph.database, poses=poses)), path)
        with pytest.raises(GraphFileError, match=f"does not hold a graph: .*{said}"):
            load_graph(path)

    def test_a_motion_file(self, character: Character, tmp_path: Path) -> None:
        from dynresp.motion.export import write_npz

        write_npz(walking_motions(character)[0], tmp_path / "walk.npz", character)
        with pytest.raises(GraphFileError, match="must hold"):
            load_graph(tmp_path / "walk.npz")

    def test_no_file(self, tmp_path: Path) -> None:
        with pytest.raises(GraphFileError, match=r"no such file; expected a \.npz graph file"):
            load_graph(tmp_path / "none.npz")


def test_damaged_files_are_refused(file: Path) -> None:
    """Bytes flipped, cut out and put in: an error of ours, or the same graph, never another one."""
    whole = file.read_bytes()
    identity = graph_identity(load_graph(file))
    chance = random.Random(20021)
    with zipfile.ZipFile(file) as archive:
        headers = [info.header_offset for info in archive.infolist()]
    for trial in range(150):
        data = bytearray(whole)
        for _ in range(chance.randint(1, 8)):
            near = chance.choice(headers) + chance.randint(0, 200) if trial % 2 else None
            at = near if near is not None else chance.randrange(len(data))
            at = min(at, len(data) - 1)
            match chance.randrange(3):
                case 0:
                    data[at] = chance.randrange(256)
                case 1:
                    del data[at : at + chance.randint(1, 64)]
                case _:
                    data[at:at] = bytes(chance.randrange(256) for _ in range(8))
        file.write_bytes(bytes(data))
        try:
            assert graph_identity(load_graph(file)) == identity
        except GraphFileError:
            continue


def test_bounds_are_told() -> None:
    assert FORMAT.problem("targets", "<i4", (60_000_000,)) is not None


def test_what_names_no_file_is_refused() -> None:
    with pytest.raises(GraphFileError, match="named by text or a Path, got 3"):
        load_graph(3)  # type: ignore[arg-type]
