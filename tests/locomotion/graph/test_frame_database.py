import numpy as np
import pytest

from dynresp.locomotion.graph.frame_database import Clip, MotionDatabase
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion, pose_velocities
from dynresp.support.errors import MotionError
from tests.motion.samples import random_poses


def made(rng: np.random.Generator, frames: int, fps: float = 30.0, name: str = "a") -> Motion:
    return Motion(random_poses(rng, frames), fps, name, rng.random((frames, 2)) > 0.5)


class TestGather:
    @pytest.mark.parametrize("given", ["abc", ["abc"], 3, None])
    def test_what_are_no_motions_is_refused(self, character: Character, given: object) -> None:
        with pytest.raises(MotionError, match="list of Motion objects, got"):
            MotionDatabase.from_motions(given, character)  # type: ignore[arg-type]

    def test_one_motion_alone_is_no_list(
        self, rng: np.random.Generator, character: Character
    ) -> None:
        with pytest.raises(MotionError, match="list of Motion objects, got Motion"):
            MotionDatabase.from_motions(made(rng, 9), character)  # type: ignore[arg-type]

    def test_lays_clips_end_to_end(self, rng: np.random.Generator, character: Character) -> None:
        motions = [made(rng, 40, name="a"), made(rng, 31, name="b")]
        database = MotionDatabase.from_motions(motions, character, 15.0)
        assert [(c.name, c.start, c.stop) for c in database.clips] == [("a", 0, 20), ("b", 20, 36)]
        np.testing.assert_array_equal(database.poses[:20], motions[0].resampled(15.0).poses)
        np.testing.assert_array_equal(database.contacts[20:], motions[1].contacts[::2])
        np.testing.assert_array_equal(database.clip_of, [0] * 20 + [1] * 16)
        assert database.successors[19] == -1
        assert database.successors[35] == -1
        assert database.successors[18] == 19

    def test_velocities_stay_inside_clips(
        self, rng: np.random.Generator, character: Character
    ) -> None:
        motions = [made(rng, 12), made(rng, 9)]
        database = MotionDatabase.from_motions(motions, character, 30.0)
        np.testing.assert_array_equal(
            database.velocities[12:], pose_velocities(database.poses[12:], 30.0)
        )

    def test_mirrors_follow(self, rng: np.random.Generator, character: Character) -> None:
        motion = made(rng, 12)
        database = MotionDatabase.from_motions([motion], character, 30.0, mirrored=True)
        mirror = motion.mirrored(character)
        np.testing.assert_allclose(database.poses[12:], mirror.poses)
        np.testing.assert_array_equal(database.contacts[12:], mirror.contacts)
        assert database.clips[1].identity == f"{database.clips[0].identity}m"

    def test_hands_are_mirrored_too(self, rng: np.random.Generator, character: Character) -> None:
        motion, touching = made(rng, 12), rng.random((12, 4)) > 0.5
        database = MotionDatabase.from_motions([motion], character, 30.0, True, [touching])
        np.testing.assert_array_equal(database.contacts[12:], touching[:, [1, 0, 3, 2]])
        states = touching @ [1, 2, 4, 8]
        np.testing.assert_array_equal(database.contact_states[:12], states)

    def test_a_motion_given_twice_is_taken_once(
        self, rng: np.random.Generator, character: Character
    ) -> None:
        motion, other = made(rng, 12), made(rng, 12)
        database = MotionDatabase.from_motions([motion, other, motion], character, 30.0)
        assert len(database.clips) == 2

    def test_short_motions_drop_out(self, rng: np.random.Generator, character: Character) -> None:
        database = MotionDatabase.from_motions([made(rng, 2), made(rng, 12)], character, 30.0)
        assert [clip.stop for clip in database.clips] == [12]
        with pytest.raises(MotionError, match="at least three frames at 15 fps; 1 motions"):
            MotionDatabase.from_motions([made(rng, 4)], character, 15.0)

    def test_contacts_must_fit(self, rng: np.random.Generator, character: Character) -> None:
        with pytest.raises(MotionError, match="every frame of every motion"):
            MotionDatabase.from_motions(
                [made(rng, 12)], character, 15.0, False, [np.ones((3, 2), bool)]
            )


def test_planar_states(rng: np.random.Generator, character: Character) -> None:
    turned = Motion(np.repeat(character.rest_pose[None], 5, axis=0), 15.0).placed(1.0, 2.0, 0.5)
    database = MotionDatabase.from_motions([turned], character)
    height = character.rest_pose[2]
    np.testing.assert_allclose(database.planar, [[1.0, 2.0, height, 0.5]] * 5, atol=1e-12)


def test_arrays_are_read_only(rng: np.random.Generator, character: Character) -> None:
    database = MotionDatabase.from_motions([made(rng, 12)], character)
    for array in (database.poses, database.velocities, database.planar, database.successors):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_clips_must_cover_the_frames(rng: np.random.Generator) -> None:
    poses, contacts = random_poses(rng, 5), np.zeros((5, 2), bool)
    with pytest.raises(MotionError, match="cover all 5 frames"):
        MotionDatabase(poses, contacts, 15.0, (Clip("a", 0, 4, ""),), "")
