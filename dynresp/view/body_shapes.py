"""The shape and the colours of the character, as every view draws it.

Each body is drawn as the convex hull of its geoms in `models/ragdoll.xml` and of a ball at each of
its joints, so that trunk and limbs taper and a bent character shows no gaps. The hull contains the
geoms: where it touches something, they do, to about a centimetre. The balls at the joints are only
drawn. Colours are those of the model file.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import mujoco
import numpy as np
import numpy.typing as npt

from dynresp.motion import rotations
from dynresp.motion.character import BodyStates, Character
from dynresp.motion.rotations import FloatArray
from dynresp.view.story import PhaseName

Color: TypeAlias = tuple[float, float, float]
"""Red, green, blue, 0 to 1."""

PHASE_COLORS: dict[PhaseName, Color] = {
    "base motion": (0.30, 0.50, 0.74),
    "physics": (0.90, 0.36, 0.17),
    "blend": (0.95, 0.71, 0.22),
    "reaction": (0.22, 0.62, 0.48),
}
"""One colour a phase, the same in every view."""

BALL_COLOR: Color = (0.85, 0.33, 0.10)
CAPSULE_COLOR: Color = (0.35, 0.30, 0.38)
BLOCK_COLOR: Color = (0.72, 0.62, 0.48)
PATH_COLORS: tuple[Color, ...] = ((0.16, 0.42, 0.70), (0.25, 0.62, 0.45))
"""Of lines on the ground, in turn."""
BOUNDS_COLOR: Color = (0.55, 0.46, 0.34)
# Shirts of the other characters.
_OTHER_SHIRTS: tuple[Color, ...] = ((0.55, 0.30, 0.48), (0.42, 0.50, 0.25), (0.62, 0.45, 0.22))

# Balls that are only drawn: body, centre in its frame [m], radius [m]; those off the middle on both
# sides.
_FILLERS: tuple[tuple[str, tuple[float, float, float], float], ...] = (
    ("pelvis", (0.0, 0.085, 0.004), 0.088),
    ("pelvis", (0.0, 0.055, 0.146), 0.092),
    ("abdomen", (0.0, 0.055, 0.0), 0.092),
    ("abdomen", (0.0, 0.062, 0.2155), 0.095),
    ("chest", (0.0, 0.062, 0.0), 0.095),
    ("chest", (0.0, 0.135, 0.135), 0.060),
    ("chest", (-0.01, 0.040, 0.175), 0.060),
    ("upper_arm", (0.0, 0.0, 0.0), 0.056),
    ("upper_arm", (0.0, 0.0, -0.2817), 0.042),
    ("forearm", (0.0, 0.0, 0.0), 0.040),
    ("forearm", (0.0, 0.0, -0.070), 0.040),
    ("thigh", (0.0, 0.0, 0.0), 0.079),
    ("thigh", (0.0, 0.0, -0.4222), 0.057),
    ("shank", (0.0, 0.0, 0.0), 0.057),
    ("shank", (-0.012, 0.0, -0.110), 0.056),
    ("shank", (0.0, 0.0, -0.430), 0.042),
    ("foot", (0.0, 0.0, -0.010), 0.039),
)
# Geoms with a hull of their own: in the hull of the whole body their joint would not show.
_OWN_HULL = ("neck", "left_hand", "right_hand")
_UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
# Radius of the edges of boxes [m].
_ROUNDING = 0.008

Part = Literal["skin", "shirt", "trousers", "shoes"]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with smooth normals.

    Attributes:
        vertices: (v, 3) [m].
        normals: (v, 3) unit vectors, outward.
        faces: (f, 3) indices of vertices, counter-clockwise from outside.
        color: One for all triangles.
    """

    vertices: FloatArray
    normals: FloatArray
    faces: npt.NDArray[np.int64]
    color: Color

    def placed(self, position: FloatArray, quaternion: FloatArray) -> Mesh:
        """The mesh turned by a quaternion (w x y z), then shifted."""
        return replace(
            self,
            vertices=position + rotations.rotate(quaternion, self.vertices),
            normals=rotations.rotate(quaternion, self.normals),
        )


@dataclass(frozen=True, eq=False)
class Solid:
    """One rigid part of a character.

    Attributes:
        name: Unique name.
        body: Index of its body, as in `Character.body_names`.
        part: Skin or clothes.
        mesh: In the frame of the body, coloured as in the model file.
    """

    name: str
    body: int
    part: Part
    mesh: Mesh


@functools.lru_cache(maxsize=4)
def character_solids(character: Character) -> tuple[Solid, ...]:
    """The solids of a character, parents before children.

    Args:
        character: Its geoms are spheres, capsules and boxes.
    """
    model = character.model
    balls: dict[str, list[tuple[FloatArray, float]]] = {}
    look: dict[str, tuple[int, Part, Color]] = {}
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom]) - 1
        name = model.geom(geom).name
        solid = name if name in _OWN_HULL else character.body_names[body]
        red, green, blue, _ = (float(x) for x in model.geom_rgba[geom])
        look.setdefault(solid, (body, _part(character.body_names[body]), (red, green, blue)))
        balls.setdefault(solid, []).extend(_balls(model, geom))
    for body_name in character.body_names:
        for kind, center, radius in _FILLERS:
            if body_name.removeprefix("left_").removeprefix("right_") == kind:
                for side in (1.0, -1.0) if center[1] else (1.0,):
                    balls[body_name].append((np.array(center) * (1.0, side, 1.0), radius))
    return tuple(
        Solid(name, body, part, hull(balls[name], color))
        for name, (body, part, color) in look.items()
    )


def place(
    solids: Sequence[Solid], states: BodyStates, frame: int, colors: Sequence[Color]
) -> list[Mesh]:
    """The solids of a character in the world, at one frame.

    Args:
        solids: From `character_solids`.
        states: The character's bodies over some frames.
        frame: Which of them.
        colors: One for each solid.
    """
    return [
        replace(solid.mesh, color=color).placed(
            states.positions[frame, solid.body], states.quaternions[frame, solid.body]
        )
        for solid, color in zip(solids, colors, strict=True)
    ]


def phase_colors(solids: Sequence[Solid], phase: PhaseName | None, share: float) -> list[Color]:
    """Colours of the solids, the clothes dyed in the colour of a phase; skin and shoes are not.

    Args:
        solids: From `character_solids`.
        phase: The phase, or None for no dye.
        share: How much of the phase's colour, 0 to 1.
    """
    if phase is None:
        return [solid.mesh.color for solid in solids]
    shirt = PHASE_COLORS[phase]
    dye = {"shirt": shirt, "trousers": mix((0.20, 0.22, 0.28), shirt, 0.22)}
    return [mix(s.mesh.color, dye.get(s.part, s.mesh.color), share) for s in solids]


def other_colors(solids: Sequence[Solid], number: int) -> list[Color]:
    """Colours of the solids of another character, `number` from 0, in another shirt."""
    shirt = _OTHER_SHIRTS[number % len(_OTHER_SHIRTS)]
    return [shirt if solid.part == "shirt" else solid.mesh.color for solid in solids]


def mix(a: Color, b: Color, share: float) -> Color:
    """The colour between a (share 0) and b (share 1)."""
    red, green, blue = ((1 - share) * x + share * y for x, y in zip(a, b, strict=True))
    return red, green, blue


def sphere(radius: float, color: Color) -> Mesh:
    """A ball about the origin."""
    return hull([(np.zeros(3), radius)], color, detail=3)


def capsule(radius: float, half_length: float, color: Color) -> Mesh:
    """A capsule about the origin, along Z; half_length is that of its straight part [m]."""
    end = np.array([0.0, 0.0, half_length])
    return hull([(end, radius), (-end, radius)], color)


def box(half_sizes: Sequence[float], color: Color) -> Mesh:
    """A box about the origin; half_sizes are half its sides [m]."""
    size = np.asarray(half_sizes, dtype=np.float64)
    vertices: list[FloatArray] = []
    normals: list[FloatArray] = []
    faces: list[tuple[int, int, int]] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            across, up = np.eye(3)[[(axis + 1) % 3, (axis + 2) % 3]]
            corners = [
                normal + a * across + b * up for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
            ]
            order = [0, 1, 2, 3] if sign > 0 else [3, 2, 1, 0]
            first = len(vertices)
            vertices += [corners[i] * size for i in order]
            normals += [normal] * 4
            faces += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    return Mesh(np.array(vertices), np.array(normals), np.array(faces), color)


def ribbon(points: FloatArray, width: float, height: float, color: Color) -> Mesh:
    """A band on the ground along a line: one flat bar for each of its segments.

    Args:
        points: (n, 2) corners of the line [m]; those at one place with their neighbour do nothing.
        width: Of the band [m].
        height: How high it stands above the ground [m].
        color: One for all triangles.
    """
    bars: list[Mesh] = []
    for a, b in itertools.pairwise(points):
        length = float(np.linalg.norm(b - a))
        if length > 0.0:
            # Half a width longer at both ends: no gaps at the corners.
            half = (0.5 * (length + width), 0.5 * width, 0.5 * height)
            middle = np.array([*(0.5 * (a + b)), 0.5 * height])
            yaw = float(np.arctan2(b[1] - a[1], b[0] - a[0]))
            bars.append(box(half, color).placed(middle, rotations.from_yaw(yaw)))
    if not bars:
        middle = np.array([*points[0], 0.5 * height])
        bars.append(box([0.5 * width, 0.5 * width, 0.5 * height], color).placed(middle, _UPRIGHT))
    starts = np.cumsum([0, *(len(bar.vertices) for bar in bars[:-1])])
    return Mesh(
        np.concatenate([bar.vertices for bar in bars]),
        np.concatenate([bar.normals for bar in bars]),
        np.concatenate([bar.faces + start for bar, start in zip(bars, starts, strict=True)]),
        color,
    )


def hull(balls: Sequence[tuple[FloatArray, float]], color: Color, detail: int = 2) -> Mesh:
    """The convex hull of balls.

    A point of the hull that lies on a ball has the ball's normal there, so the normals are exact.

    Args:
        balls: Centres (3,) and radii [m].
        color: One for all triangles.
        detail: How often the twenty faces of an icosahedron are quartered for one ball.
    """
    from scipy.spatial import ConvexHull

    directions = _sphere_points(detail)
    normals = np.tile(directions, (len(balls), 1))
    points = np.concatenate([center + radius * directions for center, radius in balls])
    outside = ConvexHull(points)
    used = outside.vertices
    renumbered = np.zeros(len(points), dtype=np.int64)
    renumbered[used] = np.arange(len(used))
    faces = renumbered[outside.simplices]
    vertices, normals = points[used], normals[used]
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    inward = np.sum(np.cross(b - a, c - a) * outside.equations[:, :3], axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(vertices, normals, faces, color)


@functools.cache
def _sphere_points(detail: int) -> FloatArray:
    """Corners of an icosahedron, its faces divided into four `detail` times, on the unit sphere."""
    golden = (1 + 5**0.5) / 2
    points = np.array(
        [np.roll((0.0, a, b * golden), k) for k in range(3) for a in (-1, 1) for b in (-1, 1)]
    )
    edge = 2.0
    for _ in range(detail):
        # Neighbours are about an edge away; their midpoints are the new corners.
        away = np.linalg.norm(points[:, None] - points[None], axis=-1)
        i, j = np.nonzero(np.triu((away > 0) & (away < 1.3 * edge)))
        scale = np.linalg.norm(points[0])
        middle = points[i] + points[j]
        middle *= scale / np.linalg.norm(middle, axis=1, keepdims=True)
        points = np.concatenate([points, middle])
        edge *= 0.5
    return np.asarray(points / np.linalg.norm(points, axis=1, keepdims=True))


def _balls(model: mujoco.MjModel, geom: int) -> list[tuple[FloatArray, float]]:
    """The balls whose hull is a geom, in its body's frame; the edges of a box are rounded."""
    size, kind = model.geom_size[geom], model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        radius = min(_ROUNDING, float(size.min()))
        corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
        centers = np.array(corners) * (size - radius)
    else:
        radius = float(size[0])
        half = float(size[1]) if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0
        centers = np.array([[0.0, 0.0, half], [0.0, 0.0, -half]])
    placed = model.geom_pos[geom] + rotations.rotate(model.geom_quat[geom], centers)
    return [(center, radius) for center in placed]


def _part(body: str) -> Part:
    if body in ("pelvis", "abdomen", "chest") or body.endswith("upper_arm"):
        return "shirt"
    if body.endswith(("thigh", "shank")):
        return "trousers"
    return "shoes" if body.endswith("foot") else "skin"
