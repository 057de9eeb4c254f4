"""The file of a graph: exact there and back, and refused where it is damaged."""

import random
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynresp.errors import GraphFileError
from dynresp.locomotion.graph import MotionGraph
from dynresp.locomotion.graph_config import Coordinates, GraphConfig
from dynresp.locomotion.graph_file import FORMAT, graph_identity, load_graph, save_graph
from dynresp.motion.character import Character, default_character
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
            (lambda a: {"targets": a["targets"] + np.int32(10**6)}, "a frame that is not there"),
            (lambda a: {"offsets": a["offsets"][::-1].copy()}, "rows of ways"),
            (lambda a: {"feet": a["feet"][:-1]}, "contacts are not given"),
            (lambda a: {"clip_stops": a["clip_stops"] - 1}, "cover all"),
            (lambda a: {"clip_names": a["clip_names"][:-1]}, "differ in number"),
            (lambda a: {"config": np.array("[]")}, "the configuration is no table"),
            (lambda a: {"config": np.array("{}")}, "coordinates"),
            (lambda a: {"config": np.array("{")}, "does not hold a graph"),
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
