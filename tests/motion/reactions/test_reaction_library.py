from pathlib import Path

import numpy as np
import pytest

from dynresp.motion import builtin, rotations
from dynresp.motion.character import Character
from dynresp.motion.export import write_npz
from dynresp.motion.reactions import reaction_library_file as library_file
from dynresp.motion.reactions.reaction_library import (
    BUILTIN,
    MIRRORED,
    STRATEGIES,
    Reaction,
    ReactionLibrary,
    builtin_library,
    default_library,
    load_library,
)
from dynresp.motion.reactions.reaction_library_file import read_entries
from dynresp.support.errors import MissingMotionDataError, SpecError, UnknownNameError
from tests.motion.samples import smooth_motion

GOOD = 'name = "duck"\nstrategy = "upper_body_front"\nfile = "a/b.npz"\nframes = [10, 30]\n'


def _file(folder: Path, *tables: str) -> Path:
    path = folder / "my.toml"
    path.write_text("".join(f"[[reaction]]\n{table}" for table in tables))
    return path


@pytest.fixture
def folder(character: Character, rng: np.random.Generator, tmp_path: Path) -> Path:
    """A motions folder with one motion of 40 frames at 30 fps."""
    (tmp_path / "a").mkdir()
    write_npz(smooth_motion(rng), tmp_path / "a/b.npz", character)
    return tmp_path


def test_reaction_is_the_stretch_at_the_origin(character: Character, folder: Path) -> None:
    library = load_library(_file(folder, GOOD), [folder], character)
    assert library.name == "my"
    reaction = library.reaction("duck")
    assert reaction.source == reaction.motion.name == "a/b.npz frames 10-30"
    assert (reaction.mirrored, reaction.builtin) == (False, False)
    motion = reaction.motion
    assert (len(motion), motion.fps) == (20, 30.0)
    assert [(x.name, x.start, x.stop) for x in motion.labels] == [("upper_body_front", 0, 20)]
    np.testing.assert_allclose(motion.root_positions[0, :2], 0.0, atol=1e-12)
    assert float(rotations.yaw_of(motion.root_quaternions[0])) == pytest.approx(0.0, abs=1e-12)


def test_each_reaction_has_its_mirror_image(character: Character, folder: Path) -> None:
    library = load_library(_file(folder, GOOD), [folder], character)
    assert [r.name for r in library.reactions] == ["duck", "duck" + MIRRORED]
    original, mirrored = library.reactions
    assert (mirrored.mirrored, mirrored.strategy) == (True, original.strategy)
    np.testing.assert_allclose(mirrored.motion.poses, character.mirror(original.motion.poses))
    np.testing.assert_array_equal(mirrored.motion.contacts, original.motion.contacts[:, ::-1])
    alone = load_library(_file(folder, GOOD), [folder], character, mirrors=False)
    assert [r.name for r in alone.reactions] == ["duck"]


def test_frame_rate_is_the_one_asked_for(character: Character, folder: Path) -> None:
    library = load_library(_file(folder, GOOD), [folder], character, fps=60.0)
    assert [len(r.motion) for r in library.reactions] == [39, 39]
    assert {r.motion.fps for r in library.reactions} == {60.0}


def test_identity_tells_libraries_apart(character: Character, folder: Path) -> None:
    def identity(table: str, fps: float = 30.0) -> str:
        return load_library(_file(folder, table), [folder], character, fps).identity

    assert identity(GOOD) == identity(GOOD + 'note = "looked at"\n')
    others = [
        GOOD.replace("duck", "bow"),
        GOOD.replace("_front", "_back"),
        GOOD.replace("30]", "29]"),
    ]
    assert len({identity(GOOD), identity(GOOD, 29.0), *map(identity, others)}) == 5


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "strategy",
            "stratagem",
            "reaction.stratagem is not a key of [reaction] (did you mean 'strategy'?)",
        ),
        ('name = "duck"\n', "", "reaction.name is missing"),
        ('"duck"', '""', "name: expected a line of 1 to 200 characters, got ''"),
        ('"duck"', "7", "name: expected a line of 1 to 200 characters, got 7"),
        ('"duck"', '"duck_mirrored"', "must not end in '_mirrored'"),
        ("upper_body_front", "faint", "reaction.strategy: expected 'step_forward_small', "),
        ('file = "a/b.npz"\n', "", "file is missing; give file and frames, or builtin"),
        ("a/b.npz", "../b.npz", "'../b.npz' is not a path inside a motions folder"),
        ("a/b.npz", "a/b.png", "'a/b.png' is not a motion file; its name must end in .amc"),
        ("frames = [10, 30]\n", "", "frames is missing; expected [first, one past the last]"),
        ("[10, 30]", "[30, 10]", "got [30, 10]"),
        ("[10, 30]", "[10, 11]", "at least two"),
        ("[10, 30]", "[-1, 30]", "got [-1, 30]"),
        ("[10, 30]", "[false, true]", "got [False, True]"),
        ("[10, 30]", "[10.0, 30.0]", "got [10.0, 30.0]"),
        ("[10, 30]", "[10, 41]", "frames: expected at most 40, the number of frames of a/b.npz"),
        ("frames", "note = 3\nframes", "note: expected a line"),
        ("frames", 'builtin = "backward_roll"\nframes', "either builtin, or file and frames"),
        (GOOD, GOOD.replace("duck", "bow") + 'x = "', "not valid TOML"),
        (
            "[[reaction]]\n",
            'title = "x"\n[[reaction]]\n',
            "title is not a key of the file",
        ),
        ("[[reaction]]", "[reaction]", "reaction: write [[reaction]], with two brackets"),
        (GOOD, GOOD + "[[reaction]]\n" + GOOD, "'duck' is given to more than one reaction"),
    ],
)
def test_wrong_file_is_refused_by_name(
    character: Character, folder: Path, old: str, new: str, message: str
) -> None:
    path = _file(folder, GOOD)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(SpecError) as caught:
        load_library(path, [folder], character)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)


def test_no_file_and_no_text_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"gone\.toml: no such file; expected a reaction library"):
        read_entries(tmp_path / "gone.toml")
    (tmp_path / "noise.toml").write_bytes(bytes(range(256)))
    with pytest.raises(SpecError, match=r"noise\.toml is not text in UTF-8"):
        read_entries(tmp_path / "noise.toml")


def test_unknown_names_list_the_known(character: Character, folder: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown library 'ful'.*'full'"):
        load_library("ful")
    library = load_library(_file(folder, GOOD), [folder], character)
    with pytest.raises(UnknownNameError, match=r"'dukc'\. Did you mean 'duck'"):
        library.reaction("dukc")


def test_missing_motion_capture_says_how_to_get_it(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(MissingMotionDataError) as caught:
        load_library("core", [tmp_path])
    for part in (str(tmp_path), "dynresp motions fetch core", "--motions", "DYNRESP_MOTIONS"):
        assert part in str(caught.value)
    own = _file(folder, GOOD.replace("a/b", "a/c"))
    with pytest.raises(MissingMotionDataError, match=r"a/c\.npz") as caught:
        load_library(own, [folder])
    assert "fetch" not in str(caught.value)


def test_missing_skeleton_counts_as_missing(tmp_path: Path) -> None:
    clip = tmp_path / "cmu/127/127_23.amc"
    clip.parent.mkdir(parents=True)
    clip.write_text("")
    path = _file(tmp_path, GOOD.replace("a/b.npz", "cmu/127/127_23.amc"))
    with pytest.raises(MissingMotionDataError, match=r"this machine: cmu/127/127\.asf \("):
        load_library(path, [tmp_path])


def test_built_in_library_stands_in(character: Character, tmp_path: Path) -> None:
    library = default_library([tmp_path], character)
    assert library.name == BUILTIN
    assert library.identity == builtin_library(character).identity
    assert load_library(BUILTIN, [], character).identity == library.identity
    assert {r.strategy for r in library.reactions} == set(STRATEGIES)
    assert all(r.builtin and r.source.startswith("built-in: ") for r in library.reactions)


def test_built_in_reaction_may_stand_in_a_file(character: Character, tmp_path: Path) -> None:
    slug = builtin_library(character, mirrors=False).reactions[0].name
    strategy = builtin.builtin_info(slug).strategy
    table = f'name = "own"\nstrategy = "{strategy}"\nbuiltin = "{slug}"\n'
    (reaction, _) = load_library(_file(tmp_path, table), [], character).reactions
    assert (reaction.name, reaction.builtin) == ("own", True)
    with pytest.raises(SpecError, match="builtin: got 'walk'; allowed: "):
        read_entries(_file(tmp_path, table.replace(f'builtin = "{slug}"', 'builtin = "walk"')))
    other = next(s for s in STRATEGIES if s != strategy)
    with pytest.raises(SpecError, match=f"strategy: got '{other}', but the built-in motion"):
        read_entries(_file(tmp_path, table.replace(f'= "{strategy}"', f'= "{other}"', 1)))


# What real motion capture must keep to, whatever is added to the shipped libraries.

# Slower than the pelvis goes in any step; sway and the settling of the trunk stay below it.
AT_REST = 0.35
# A blow or push changes the speed of head or chest by this much [m/s]; sway does not.
STRUCK = 0.3
# Faster than this, no part of a person moves but by a glitch of the recording [m/s].
TOO_FAST = 16.0


@pytest.fixture(scope="module", params=["core", "full"])
def recorded(
    request: pytest.FixtureRequest, motions_folder: Path, character: Character
) -> ReactionLibrary:
    return load_library(request.param, [motions_folder], character, mirrors=False)


def _path(reaction: Reaction) -> np.ndarray:
    return reaction.motion.root_positions - reaction.motion.root_positions[0]


@pytest.mark.mocap
def test_recorded_libraries_hold_enough(motions_folder: Path, character: Character) -> None:
    core, full = (load_library(name, [motions_folder], character) for name in ("core", "full"))
    originals = [[r for r in library.reactions if not r.mirrored] for library in (core, full)]
    assert sorted(r.strategy for r in originals[0]) == sorted(STRATEGIES)
    assert len(originals[1]) >= 110
    assert {r.strategy for r in originals[1]} == set(STRATEGIES)
    for library in (core, full):
        assert not any(r.builtin for r in library.reactions)
        names = {r.name for r in library.reactions}
        assert all(r.mirrored or r.name + MIRRORED in names for r in library.reactions)
    assert default_library([motions_folder], character).identity == core.identity


@pytest.mark.mocap
def test_stretches_begin_with_the_hit(recorded: ReactionLibrary, character: Character) -> None:
    upper = [character.body("chest"), character.body("head")]
    late = []
    for reaction in recorded.reactions:
        positions = character.kinematics(reaction.motion.poses).positions[:, upper]
        velocity = np.gradient(positions, 1.0 / reaction.motion.fps, axis=0)
        change = np.linalg.norm(velocity - velocity[0], axis=-1).max(axis=1)
        if change[: round(0.5 * reaction.motion.fps)].max() < STRUCK:
            late.append(reaction.name)
    assert not late


@pytest.mark.mocap
def test_stretches_end_on_two_feet_or_at_rest(recorded: ReactionLibrary) -> None:
    restless = []
    for reaction in recorded.reactions:
        motion = reaction.motion
        speed = np.linalg.norm(motion.velocities()[-1, :3])
        if not motion.contacts[-1].all() and speed > AT_REST:
            restless.append((reaction.name, round(float(speed), 2)))
    assert not restless


@pytest.mark.mocap
def test_stretches_are_sound(recorded: ReactionLibrary, character: Character) -> None:
    from dynresp.motion.retargeting.retarget import t_pose_frames

    for reaction in recorded.reactions:
        motion = reaction.motion
        assert 0.9 <= motion.duration <= 8.0, reaction.name
        assert not t_pose_frames(character, motion).any(), reaction.name
        positions = character.kinematics(motion.poses).positions
        speeds = np.linalg.norm(np.diff(positions, axis=0), axis=-1) * motion.fps
        assert speeds.max() < TOO_FAST, reaction.name


@pytest.mark.mocap
def test_strategies_say_what_happens(recorded: ReactionLibrary, character: Character) -> None:
    """The hit person goes where the strategy says, in their own facing before the hit."""
    wrong = []
    for reaction in recorded.reactions:
        path, height = _path(reaction), reaction.motion.root_positions[:, 2]
        states = character.kinematics(reaction.motion.poses)
        head = states.positions[:, character.body("head"), 2]
        ahead, behind = path[:, 0].max(), -path[:, 0].min()
        ok = {
            "step_forward": ahead > max(0.2, behind),
            "multiple_steps_forward": ahead > max(0.5, behind),
            "step_backward": behind > max(0.15, ahead),
            "multiple_steps_backward": behind > max(0.5, ahead),
            "forward_roll": ahead > 0.5 and height.min() < 0.45,
            "backward_roll": height.min() < 0.35,
            "side_fall": height.min() < 0.5,
            "upper_body": head.min() > 0.6,
        }
        kind = next(kind for kind in ok if reaction.strategy.startswith(kind))
        if not ok[kind]:
            wrong.append((reaction.name, round(ahead, 2), round(behind, 2), height.min().round(2)))
    assert not wrong


@pytest.mark.mocap
@pytest.mark.parametrize("name", ["core", "full"])
def test_all_motion_capture_is_in_the_source_table(name: str) -> None:
    from dynresp.motion.sources.catalogue import load_sources
    from dynresp.support.paths import reactions_folder

    entries = library_file.read_entries(reactions_folder() / f"{name}.toml")
    sources = load_sources()
    assert {sources[e.file].kind for e in entries if e.file} == {"clip"}
