"""Videos of people who are not the character: a room, clothes, and a bad camera.

A pinhole camera stands in a room with patterned walls and floor. Light moves across the picture,
the person throws a soft shadow, and the sensor is noisy. Everything follows from a seed. Nothing
is shared with how the silhouettes of a database are drawn.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import mujoco
import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import BodyStates, Character
from dynresp.motion.motion import Motion
from dynresp.motion.rotations import FloatArray
from dynresp.support.errors import DynrespError

Frame = npt.NDArray[np.uint8]

SIZE = (320, 240)
"""Width and height of the pictures [pixels]."""


@dataclass(frozen=True)
class Filming:
    """How a video is made.

    Attributes:
        seed: Of the room, the clothes, the light, the noise and where the camera stands.
        fps: Frames per second.
        empty_s: How long the room is seen before the person appears [s].
        noise: Standard deviation of the sensor's noise [of 255].
        light: How much brighter and darker the moving light makes it, as a share.
        yaw: Direction in which the camera looks [rad]; by default from the seed.
    """

    seed: int = 0
    fps: float = 30.0
    empty_s: float = 1.0
    noise: float = 5.0
    light: float = 0.25
    yaw: float | None = None


class Camera:
    """A pinhole camera that sees all positions of a person."""

    def __init__(self, places: FloatArray, tall: float, rng: np.random.Generator, yaw: float):
        """Stand back far enough.

        Args:
            places: (n, 2) of the ground [m].
            tall: How high the person reaches [m].
            rng: For height and distance.
            yaw: Where it looks [rad].
        """
        width, height = SIZE
        self.focal = 1.1 * width
        middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
        ahead = np.array([np.cos(yaw), np.sin(yaw)])
        right = np.array([ahead[1], -ahead[0]])
        relative = places - middle
        aside, away = np.abs(relative @ right) + 0.6, relative @ ahead
        needed = max(
            float(np.max(aside * self.focal / (0.48 * width) - away)),
            float(np.max(0.5 * (tall + 0.7) * self.focal / (0.48 * height) - away)),
        )
        distance = max(needed, 3.0) * rng.uniform(1.0, 1.15)
        eye_height = rng.uniform(1.0, 2.0)
        self.eye = np.array([*(middle - distance * ahead), eye_height])
        target = np.array([*middle, 0.5 * tall])
        forward = target - self.eye
        forward /= np.linalg.norm(forward)
        self.right = np.array([right[0], right[1], 0.0])
        self.forward = forward
        self.up = np.cross(self.right, forward)

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixels (..., 2) and depth (...) [m] of points (..., 3)."""
        relative = points - self.eye
        depth = relative @ self.forward
        x = SIZE[0] / 2 + self.focal * (relative @ self.right) / depth
        y = SIZE[1] / 2 - self.focal * (relative @ self.up) / depth
        return np.stack([x, y], axis=-1), depth


def film(
    motion: Motion, character: Character, filming: Filming, masks: list[Frame] | None = None
) -> Iterator[Frame]:
    """A video of somebody's motion.

    Args:
        motion: What is done, on the person's own skeleton.
        character: The person.
        filming: How it is filmed.
        masks: If given, gets the mask of the person for each frame.

    Yields:
        Pictures (height, width, 3), blue green red.
    """
    rng = np.random.default_rng(filming.seed)
    width, height = SIZE
    times = np.arange(int(motion.duration * filming.fps) + 1) / filming.fps
    poses = motion.sample(times)
    states = character.kinematics(poses)
    yaw = rng.uniform(0, 2 * np.pi) if filming.yaw is None else filming.yaw
    tall = float(states.positions[:, :, 2].max()) + 0.2
    places = states.positions[..., :2].reshape(-1, 2)
    camera = Camera(places, tall, rng, yaw)
    room = _room(rng, camera)
    clothes = _clothes(rng, character, room)
    empty = round(filming.empty_s * filming.fps)
    light_way, light_speed = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.2)
    y, x = np.mgrid[0:height, 0:width] / width
    along = np.cos(light_way) * x + np.sin(light_way) * y
    for k in range(empty + len(poses)):
        picture = room.copy()
        mask = np.zeros((height, width), dtype=np.uint8)
        if k >= empty:
            frame = k - empty
            _shadow(picture, camera, states.positions[frame])
            _draw(picture, mask, camera, character, states, frame, clothes)
        if masks is not None:
            masks.append(mask)
        # A bright band about as wide as the picture drifts over it and back.
        phase = 2.0 * np.pi * (0.8 * along - light_speed * k / filming.fps / 4.0)
        gain = 1.0 + filming.light * np.sin(phase)
        picture = picture * gain[..., None]
        picture += rng.normal(0.0, filming.noise, picture.shape)
        yield np.clip(picture, 0, 255).astype(np.uint8)


def write_video(path: Path, frames: Iterator[Frame], fps: float, codec: str = "mp4v") -> None:
    """Write pictures into a file with a lossy codec.

    Raises:
        DynrespError: This OpenCV cannot write it.
    """
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), fps, SIZE)
    if not writer.isOpened():
        raise DynrespError(f"{path}: OpenCV cannot write a video with the codec {codec!r}")
    for frame in frames:
        writer.write(frame)
    writer.release()


def _noise(rng: np.random.Generator, shape: tuple[int, int]) -> FloatArray:
    """Smooth noise of several sizes, about 0, standard deviation about 1."""
    height, width = shape
    total = np.zeros(shape)
    for cells in (4, 9, 24, 70):
        coarse = rng.normal(size=(cells * 3 // 4 + 1, cells)).astype(np.float32)
        total += cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return total / 2.0


def _room(rng: np.random.Generator, camera: Camera) -> FloatArray:
    """Walls with pictures and cupboards, and a floor, patterned."""
    width, height = SIZE
    wall, floor = rng.uniform(70, 190, 3), rng.uniform(60, 170, 3)
    room = np.empty((height, width, 3))
    skirting = int(
        np.clip(camera.project(camera.eye + 6 * camera.forward - [0, 0, 1.0])[0][1], 90, 170)
    )
    room[:skirting], room[skirting:] = wall, floor
    for _ in range(7):
        x, y = int(rng.integers(0, width)), int(rng.integers(0, skirting))
        w, h = int(rng.integers(15, 70)), int(rng.integers(15, 60))
        cv2.rectangle(room, (x, y), (x + w, y + h), rng.uniform(40, 215, 3).tolist(), -1)
    for x in range(0, width, 24):
        cv2.line(room, (x, skirting), (2 * x - width // 2, height), (floor * 0.8).tolist(), 1)
    return np.clip(room + 9.0 * _noise(rng, (height, width))[..., None], 10, 245)


def _clothes(rng: np.random.Generator, character: Character, room: FloatArray) -> list[FloatArray]:
    """A colour a geom: skin, shirt, trousers and shoes, the clothes unlike the room's mean."""
    mean = room.mean(axis=(0, 1))

    def cloth() -> FloatArray:
        while True:
            color = rng.uniform(10, 245, 3)
            if np.linalg.norm(color - mean) > 70:
                return color

    shirt, trousers, shoes = cloth(), cloth(), cloth()
    skin = rng.uniform(0.5, 1.1) * np.array([130.0, 160.0, 205.0])
    out = []
    for geom in range(character.model.ngeom):
        body = character.body_names[int(character.model.geom_bodyid[geom]) - 1]
        name = character.model.geom(geom).name
        if body in ("pelvis", "abdomen", "chest") or name.endswith("arm"):
            out.append(trousers if body == "pelvis" else shirt)
        elif body.endswith(("thigh", "shank")):
            out.append(trousers)
        else:
            out.append(shoes if body.endswith("foot") else skin)
    return out


def _draw(
    picture: FloatArray,
    mask: Frame,
    camera: Camera,
    character: Character,
    states: BodyStates,
    frame: int,
    colors: list[FloatArray],
) -> None:
    """Paint the geoms, from back to front."""
    model = character.model
    pieces = []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom]) - 1
        position, quaternion = states.positions[frame, body], states.quaternions[frame, body]
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
            corners = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
            local, radius = corners * model.geom_size[geom], 0.0
        else:
            half = model.geom_size[geom, 1]
            local, radius = np.array([[0, 0, half], [0, 0, -half]]), model.geom_size[geom, 0]
        local = model.geom_pos[geom] + rotations.rotate(model.geom_quat[geom], local)
        pixels, depth = camera.project(position + rotations.rotate(quaternion, local))
        turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
        circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        spread = radius * camera.focal / depth
        points = (pixels[:, None] + spread[:, None, None] * circle).reshape(-1, 2)
        outline = cv2.convexHull((points * 16).round().astype(np.int32))
        pieces.append((float(depth.mean()), outline, colors[geom]))
    for _, outline, color in sorted(pieces, key=lambda p: -p[0]):
        shade = 1.0 + 0.1 * np.sin(len(outline))
        cv2.fillConvexPoly(picture, outline, (color * shade).tolist(), cv2.LINE_8, 4)
        cv2.fillConvexPoly(mask, outline, 255, cv2.LINE_8, 4)


def _shadow(picture: FloatArray, camera: Camera, positions: FloatArray) -> None:
    """A soft dark patch on the floor, aside of the body."""
    dark = np.zeros(picture.shape[:2], dtype=np.float32)
    ground = positions * [1, 1, 0] + positions[:, 2:] * [0.25, 0.15, 0.0]
    pixels, depth = camera.project(ground)
    for (x, y), z in zip(pixels, depth, strict=True):
        size = (int(0.14 * camera.focal / z), int(0.05 * camera.focal / z) + 1)
        cv2.ellipse(dark, (int(x), int(y)), size, 0, 0, 360, 1.0, -1)
    picture *= 1.0 - 0.35 * cv2.GaussianBlur(dark, (0, 0), 3.0)[..., None]
