"""Motions and simulations for the tests of physics."""

import copy
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.physics.impacts import Ball, Impact
from dynresp.physics.prepared_impact import prepare
from dynresp.physics.scene import PhysicsConfig, Scene
from dynresp.physics.simulation import Simulation
from dynresp.physics.trace import Setup

FPS = 30.0

ImpactType = TypeVar("ImpactType", bound=Impact)


def turned(character: Character, joints: dict[str, FloatArray], frames: int) -> FloatArray:
    """Rest poses (frames, 59) whose named joints are turned by rotation vectors (frames, 3)."""
    poses = np.repeat(character.rest_pose[None], frames, axis=0)
    for name, vectors in joints.items():
        column = 7 + 4 * character.joint(name)
        poses[:, column : column + 4] = rotations.from_rotation_vector(vectors)
    return poses


def about_y(angles: FloatArray) -> FloatArray:
    """Rotation vectors (frames, 3) about +Y, which swings a hanging limb backward."""
    return np.stack([np.zeros_like(angles), angles, np.zeros_like(angles)], axis=1)


def standing(character: Character, seconds: float = 3.0, fps: float = FPS) -> Motion:
    """The rest pose, held."""
    return Motion(turned(character, {}, round(seconds * fps) + 1), fps, "standing")


def walking(
    character: Character,
    seconds: float = 3.0,
    fps: float = FPS,
    speed: float = 1.2,
    yaw: float = 0.0,
) -> Motion:
    """Legs, arms and trunk swinging by sines over a pelvis that goes ahead, facing yaw."""
    frames = round(seconds * fps) + 1
    time = np.arange(frames) / fps
    phase = 2.0 * np.pi * 0.9 * time
    joints = {"back": np.stack([0 * phase, 0 * phase, 0.1 * np.sin(phase)], axis=1)}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        joints[f"{side}_hip"] = about_y(sign * 0.4 * np.sin(phase) - 0.1)
        joints[f"{side}_knee"] = about_y(0.35 + 0.3 * np.sin(phase + sign * 1.5))
        joints[f"{side}_ankle"] = about_y(-0.1 + 0.1 * np.sin(phase))
        # The arms hang a little outward, clear of the hips.
        outward = np.outer(np.ones(frames), [sign * 0.1, 0.0, 0.0])
        joints[f"{side}_shoulder"] = about_y(-sign * 0.35 * np.sin(phase)) + outward
        joints[f"{side}_elbow"] = about_y(-0.4 - 0.1 * np.sin(phase))
    poses = turned(character, joints, frames)
    poses[:, 0] = speed * time
    poses[:, 2] += 0.02 * np.sin(2.0 * phase)
    return Motion(poses, fps, "walking").moved(yaw, (0.0, 0.0, 0.0))


def punching(character: Character, seconds: float = 1.5, fps: float = FPS) -> Motion:
    """The right arm, bent at the side, is thrown forward and up; out at 0.6 s, back by 0.9 s."""
    frames = round(seconds * fps) + 1
    time = np.arange(frames) / fps
    out = np.exp(-(((time - 0.6) / 0.13) ** 2))
    joints = {
        "right_shoulder": about_y(0.5 - 2.1 * out),
        "right_elbow": about_y(-2.0 + 1.85 * out),
    }
    return Motion(turned(character, joints, frames), fps, "punching")


def beyond_bounds(impact: ImpactType, **values: float) -> ImpactType:
    """An impact with numbers that it would refuse, for simulations that diverge."""
    changed = copy.copy(impact)
    for name, value in values.items():
        object.__setattr__(changed, name, value)
    return changed


def absurd_ball(time: float) -> Ball:
    """1000 kg at 1000 m/s: the first step of the contact is too much for the solver."""
    return beyond_bounds(Ball(time, height=1.3), speed=1000.0, mass=1000.0)


def setups_of(
    character: Character, base: Motion, impacts: Sequence[Impact], config: PhysicsConfig
) -> list[Setup]:
    """Prepare impacts on one base motion."""
    prepared = [prepare(impact, base, character, config) for impact in impacts]
    return [Setup(base.poses[p.start :], p) for p in prepared]


def simulation_of(
    scene: Scene, base: Motion, impacts: Sequence[Impact], threads: int = 1
) -> Simulation:
    """A simulation of impacts on one base motion."""
    setups = setups_of(scene.character, base, impacts, scene.config)
    return Simulation(scene, setups, threads)
