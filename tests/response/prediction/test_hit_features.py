"""Features of hits: against their twin, and what must not change them."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynresp.motion import rotations
from dynresp.motion.character import Character, default_character
from dynresp.motion.motion import move_poses
from dynresp.motion.rotations import FloatArray
from dynresp.response.prediction.hit_features import (
    BODIES,
    FEATURE_NAMES,
    PAPER_SLICES_S,
    SLICES_S,
    extract,
    identity,
    vector_columns,
)
from dynresp.support.errors import MotionError, UsageError
from tests.oracles import features as twin

FPS = 30.0
SEEDS = st.integers(0, 2**32 - 1)


def _hits(seed: int, hits: int = 3, frames: int = 16) -> tuple[FloatArray, FloatArray]:
    """Random poses and velocities; no joint is turned by half a turn in the world."""
    rng = np.random.default_rng(seed)
    poses = np.zeros((hits, frames, 59))
    poses[..., :3] = rng.normal(size=(hits, frames, 3))
    turns = rng.normal(scale=0.15, size=(hits, frames, 14, 3))
    poses[..., 3:] = rotations.from_rotation_vector(turns).reshape(hits, frames, 56)
    return poses, rng.normal(scale=2.0, size=(hits, frames, 45))


@settings(max_examples=15, deadline=None)
@given(SEEDS)
def test_equal_to_the_twin(seed: int) -> None:
    character = default_character()
    poses, velocities = _hits(seed)
    ours = extract(character, poses, velocities, FPS)
    assert ours.shape == (3, len(FEATURE_NAMES))
    for hit in range(3):
        expected = twin.slices(character, poses[hit], velocities[hit], [0, 3, 6, 9, 12, 15])
        # The twin finds the facing by a search of its own, to about 1e-4.
        np.testing.assert_allclose(ours[hit], expected, atol=2e-3)


def test_velocities_are_mujocos(character: Character) -> None:
    poses, velocities = _hits(3, hits=1, frames=1)
    poses[0, 0, :7] = [0.3, -0.2, 1.0, 1.0, 0.0, 0.0, 0.0]
    found = dict(zip(FEATURE_NAMES, extract(character, poses, velocities, FPS)[0], strict=True))
    data = mujoco.MjData(character.model)
    data.qpos, data.qvel = poses[0, 0], velocities[0, 0]
    mujoco.mj_forward(character.model, data)
    both = np.empty(6)
    for name in BODIES:
        # Angular first, then linear of the centre of mass, in axes of the world.
        kind, body = mujoco.mjtObj.mjOBJ_BODY, character.body(name) + 1
        mujoco.mj_objectVelocity(character.model, data, kind, body, both, 0)
        for k, axis in enumerate("xyz"):
            assert found[f"0.0/{name}/angular_velocity_{axis}"] == pytest.approx(both[k], abs=1e-5)
            assert found[f"0.0/{name}/velocity_{axis}"] == pytest.approx(both[3 + k], abs=1e-5)


@settings(max_examples=15, deadline=None)
@given(SEEDS, st.floats(-3.0, 3.0), st.floats(-9.0, 9.0))
def test_place_and_heading_do_not_matter(seed: int, yaw: float, x: float) -> None:
    character = default_character()
    poses, velocities = _hits(seed, hits=1)
    moved = move_poses(poses[0], yaw, (x, 2.0, 0.0))[None]
    turned = velocities.copy()
    # In a row of qvel only the root's linear velocity is in world axes.
    turned[..., :3] = rotations.rotate(rotations.from_yaw(yaw), velocities[..., :3])
    here, there = (extract(character, p, v, FPS) for p, v in ((poses, velocities), (moved, turned)))
    np.testing.assert_allclose(here, there, atol=1e-5)


def test_a_mirrored_hit_has_mirrored_features(character: Character) -> None:
    poses, velocities = _hits(4, hits=1)
    mirrored = character.mirror(poses[0])[None]
    there = velocities.copy()
    there[..., :3] *= [1, -1, 1]
    # Rates are vectors along axes: their mirror image turns the other way.
    rates = velocities[..., 3:].reshape(1, 16, 14, 3)[:, :, character.mirror_bodies]
    there[..., 3:] = (rates * [-1, 1, -1]).reshape(1, 16, 42)
    here = dict(zip(FEATURE_NAMES, extract(character, poses, velocities, FPS)[0], strict=True))
    other = dict(zip(FEATURE_NAMES, extract(character, mirrored, there, FPS)[0], strict=True))
    for name, value in here.items():
        swapped = name.replace("left", "?").replace("right", "left").replace("?", "right")
        turning = "orientation" in name or "angular" in name
        flips = name[-1] in "xz" if turning else name[-1] == "y"
        assert other[swapped] == pytest.approx(-value if flips else value, abs=1e-5), name


def test_a_hit_alone_has_the_same_bits(character: Character) -> None:
    poses, velocities = _hits(2, hits=17)
    together = extract(character, poses, velocities, FPS)
    for hit in range(17):
        alone = extract(character, poses[hit : hit + 1], velocities[hit : hit + 1], FPS)
        np.testing.assert_array_equal(alone[0], together[hit])


def test_slices_after_the_last_frame_are_nan(character: Character) -> None:
    poses, velocities = _hits(1, frames=10)
    seen = np.isfinite(extract(character, poses, velocities, FPS)).all(axis=0)
    reached = [float(name.split("/")[0]) <= 0.3 for name in FEATURE_NAMES]
    np.testing.assert_array_equal(seen, reached)


def test_vectors_of_the_paper() -> None:
    large, small = vector_columns("large"), vector_columns("small")
    assert len(large) == 6 * 12 * 4
    assert len(small) == 20
    assert not any("com" in FEATURE_NAMES[column] for column in large)
    assert any("com" in FEATURE_NAMES[column] for column in small)
    assert len(vector_columns("large", SLICES_S)) == 6 * 12 * 6


@pytest.mark.parametrize("left_out", PAPER_SLICES_S)
def test_any_slices_can_be_selected(left_out: float) -> None:
    kept = [slice_s for slice_s in PAPER_SLICES_S if slice_s != left_out]
    columns = vector_columns("large", kept)
    assert {float(FEATURE_NAMES[column].split("/")[0]) for column in columns} == set(kept)


def test_unknown_vectors_and_slices_are_refused(character: Character) -> None:
    with pytest.raises(UsageError, match="large, small, got 'huge'"):
        vector_columns("huge")
    with pytest.raises(UsageError, match=r"0\.5 s, got 0\.15"):
        vector_columns("large", [0.15])
    with pytest.raises(UsageError, match="got none"):
        vector_columns("large", [])
    with pytest.raises(UsageError, match=r"at 0\.0, 0\.1, 0\.3 s only"):
        vector_columns("small", [0.2])
    with pytest.raises(MotionError, match=r"got \(2, 59\)"):
        extract(character, np.zeros((2, 59)), np.zeros((2, 45)), FPS)


def test_the_identity_changes_only_with_the_features() -> None:
    """If this fails, earlier models and datasets are refused: raise `VERSION` only on purpose."""
    assert len(FEATURE_NAMES) == len(set(FEATURE_NAMES)) == 468
    assert identity() == "105c24eca2adc695"


def test_a_quaternion_and_its_negative_are_the_same(character: Character) -> None:
    poses, velocities = _hits(6)
    signs = np.random.default_rng(6).choice([-1.0, 1.0], size=(3, 16, 14, 1))
    other = poses.copy()
    other[..., 3:] = (poses[..., 3:].reshape(3, 16, 14, 4) * signs).reshape(3, 16, 56)
    np.testing.assert_allclose(
        extract(character, other, velocities, FPS),
        extract(character, poses, velocities, FPS),
        atol=1e-6,
    )
