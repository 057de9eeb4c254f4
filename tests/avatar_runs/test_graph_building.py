import shutil
from pathlib import Path

import pytest

from dynresp.avatar_runs import graph_building as building
from dynresp.avatar_runs.graph_building import build_graph
from dynresp.avatar_runs.graph_spec import GraphSpec, find_graph_spec, read_graph_spec
from dynresp.locomotion.graph.graph_file import graph_identity
from dynresp.motion.character import Character
from dynresp.motion.export import write_npz
from dynresp.support.errors import MissingMotionDataError, SpecError
from tests.locomotion.samples import walking_motions


def spec(*motions: str, **more: object) -> GraphSpec:
    """A graph spec of some motions."""
    content = {
        "graph": {"name": "small", "sigma": 0.3},
        "motion": [{"motion": name} for name in motions],
        **more,
    }
    return GraphSpec.model_validate(content)


def quiet(stage: str, done: int, of: int) -> None:
    """Progress that shows nothing."""


@pytest.fixture
def folder(character: Character, tmp_path: Path) -> Path:
    for number, motion in enumerate(walking_motions(character)):
        write_npz(motion, tmp_path / "walks" / f"walk_{number}.npz", character)
    return tmp_path


def test_wildcards_stand_for_files(folder: Path, character: Character) -> None:
    graph = build_graph(spec("walks/walk_*.npz"), [folder], folder, character, quiet)
    assert len(graph.database.clips) == 4
    fewer = spec("walks/*.npz", leave_out=["walks/walk_3.npz"])
    assert len(build_graph(fewer, [folder], folder, character, quiet).database.clips) == 3


def test_same_motions_same_graph(folder: Path, character: Character) -> None:
    names = [f"walks/walk_{number}.npz" for number in range(4)]
    given = build_graph(spec(*names), [folder], folder, character, quiet)
    found = build_graph(spec("walks/*.npz"), [folder], folder, character, quiet)
    assert graph_identity(given) == graph_identity(found)


def test_only_the_named_folder_is_searched(
    folder: Path, character: Character, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "photos" / "old").mkdir(parents=True)
    searched: list[Path] = []
    list_files = building.list_motion_files

    def watched(where: Path, levels: int) -> list[Path]:
        searched.append(where)
        return list_files(where, levels)

    monkeypatch.setattr(building, "list_motion_files", watched)
    for motions in ([folder], [folder / "photos", folder]):
        graph = build_graph(spec("walks/walk_*.npz"), motions, folder / "photos", character, quiet)
        assert len(graph.database.clips) == 4
        assert searched == [folder / "walks"]
        searched.clear()


@pytest.mark.parametrize("name", ["/walks/*.npz", "../walks/*.npz", "walks/../*.npz"])
def test_wildcards_stay_inside_their_folder(folder: Path, character: Character, name: str) -> None:
    with pytest.raises(SpecError, match="not a path inside a motions folder"):
        build_graph(spec(name), [folder], folder / "walks", character, quiet)


@pytest.mark.parametrize("name", ["builtin:w*", "builtin:*"])
def test_built_in_motion_has_no_wildcards(folder: Path, character: Character, name: str) -> None:
    with pytest.raises(SpecError, match=r"named one by one.*; there are .*\bwalk\b"):
        build_graph(spec(name), [folder], folder, character, quiet)


def test_wildcards_stand_for_no_folders(folder: Path, character: Character) -> None:
    with pytest.raises(MissingMotionDataError, match=r"\*\.npz"):
        build_graph(spec("*.npz"), [folder], folder, character, quiet)
    (folder / "walks").rename(folder / "old")
    (folder / "walks").mkdir()
    (folder / "old").rename(folder / "walks" / "old")
    with pytest.raises(MissingMotionDataError, match=r"walks/\*\.npz"):
        build_graph(spec("walks/*.npz"), [folder], folder, character, quiet)
    graph = build_graph(spec("*/old/*.npz"), [folder], folder, character, quiet)
    assert len(graph.database.clips) == 4


def test_motions_to_leave_out_must_exist(folder: Path, character: Character) -> None:
    wrong = spec("walks/*.npz", leave_out=["walks/walk_03.npz"])
    with pytest.raises(SpecError, match=r"03.npz' is not one of the 4.*walks/walk_3.npz"):
        build_graph(wrong, [folder], folder, character, quiet)
    nothing = spec("walks/walk_3.npz", leave_out=["walks/walk_3.npz"])
    with pytest.raises(SpecError, match="leave_out names all motions"):
        build_graph(nothing, [folder], folder, character, quiet)


def test_progress_names_its_stages(folder: Path, character: Character) -> None:
    stages: list[str] = []
    build_graph(
        spec("walks/*.npz"), [folder], folder, character, lambda stage, _, __: stages.append(stage)
    )
    assert stages == ["loading motions"] * 4 + ["finding contacts", "comparing frames"]


@pytest.mark.parametrize("name", ["walks/none.npz", "none/*.bvh"])
def test_missing_motions_are_reported(folder: Path, character: Character, name: str) -> None:
    with pytest.raises(MissingMotionDataError, match=r"not on this machine: .*dynresp graph build"):
        build_graph(spec(name), [folder], folder, character, quiet)


def test_built_in_motion_needs_no_folder(character: Character, tmp_path: Path) -> None:
    path = find_graph_spec("builtin")
    graph = build_graph(read_graph_spec(path), [], path.parent, character, quiet)
    assert graph.database.credits == ()
    assert all(clip.name.startswith("built-in: ") for clip in graph.database.clips)
    assert len(graph.frames) > 0


@pytest.mark.mocap
def test_walking(motions_folder: Path, character: Character) -> None:
    path = find_graph_spec("walking")
    graph = build_graph(read_graph_spec(path), [motions_folder], path.parent, character, quiet)
    assert len(graph.database.clips) > 80
    assert graph.counts.component_frames > 0.7 * len(graph.database)
    assert any("Movement Research Lab" in line for line in graph.database.credits)


@pytest.mark.mocap
def test_a_folder_of_the_users_own(
    motions_folder: Path, character: Character, tmp_path: Path
) -> None:
    shutil.copy(
        motions_folder / "snumrl_DataDrivenBipedController/woddy2_walk_normal_stright.bvh",
        tmp_path / "mine.bvh",
    )
    graph = build_graph(spec("mine.bvh"), [], tmp_path, character, quiet)
    assert len(graph.database) > 500
