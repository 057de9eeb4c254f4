from __future__ import annotations

import numpy as np

from dynresp.motion import rotations
from dynresp.motion.character import default_character
from dynresp.view import body_shapes as shapes


def test_a_ball_is_a_ball() -> None:
    mesh = shapes.sphere(0.3, (1.0, 0.0, 0.0))
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.3)
    np.testing.assert_allclose(mesh.normals, mesh.vertices / 0.3, atol=1e-12)
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    volume = np.sum(np.cross(a, b) * c) / 6
    assert 0.97 < volume / (4 / 3 * np.pi * 0.3**3) < 1.0
    # A closed surface: each edge is met once in each direction.
    edges = np.concatenate([mesh.faces[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    assert {tuple(e) for e in edges} == {tuple(e[::-1]) for e in edges}


def test_skins_hold_the_geoms() -> None:
    character = default_character()
    model = character.model
    rng = np.random.default_rng(0)
    directions = rotations.normalize(rng.normal(size=(200, 4)))[:, :3]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    by_body: dict[int, list[float]] = {}
    for solid in shapes.character_solids(character):
        reach = (solid.mesh.vertices @ directions.T).max(axis=0)
        old = by_body.get(solid.body, np.full(200, -np.inf))
        by_body[solid.body] = np.maximum(old, reach)
    assert len(by_body) == len(character.body_names)
    for geom in range(model.ngeom):
        center, size = model.geom_pos[geom], model.geom_size[geom]
        local = rotations.rotate(rotations.conjugate(model.geom_quat[geom]), directions)
        if model.geom_type[geom] == 6:
            half = np.abs(local) @ size
        else:
            half = size[0] + size[1] * np.abs(local[:, 2])
        wanted = directions @ center + half
        # Flat triangles stay inside a ball, and the edges of boxes are rounded.
        assert (by_body[model.geom_bodyid[geom] - 1] >= wanted - 0.007).all(), geom


def test_left_mirrors_right() -> None:
    solids = {solid.name: solid for solid in shapes.character_solids(default_character())}
    left, right = solids["left_thigh"].mesh, solids["right_thigh"].mesh
    mirrored = left.vertices * (1, -1, 1)
    for points in (left.vertices.max(axis=0) * (1, 1, 1), mirrored.max(axis=0)):
        np.testing.assert_allclose(points[[0, 2]], right.vertices.max(axis=0)[[0, 2]], atol=1e-3)


def test_placed_where_the_body_is() -> None:
    character = default_character()
    states = character.kinematics(character.rest_pose)
    solids = shapes.character_solids(character)
    meshes = shapes.place(solids, states, 0, shapes.phase_colors(solids, None, 0.0))
    points = np.concatenate([mesh.vertices for mesh in meshes])
    assert abs(points[:, 2].min()) < 0.005
    assert 1.70 < points[:, 2].max() < 1.78


def test_only_clothes_are_dyed() -> None:
    solids = shapes.character_solids(default_character())
    dyed = shapes.phase_colors(solids, "physics", 1.0)
    for solid, color in zip(solids, dyed, strict=True):
        changed = color != solid.mesh.color
        assert changed == (solid.part in ("shirt", "trousers")), solid.name


def test_a_ribbon_lies_along_its_line() -> None:
    points = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    mesh = shapes.ribbon(points, 0.1, 0.02, (0.0, 0.0, 1.0))
    np.testing.assert_allclose(mesh.vertices.min(axis=0), [-0.05, -0.05, 0.0], atol=1e-12)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [2.05, 1.05, 0.02], atol=1e-12)
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    outward = np.sum(np.cross(b - a, c - a) * mesh.normals[mesh.faces[:, 0]], axis=1)
    assert (outward > 0).all()
    assert len(mesh.faces) == 2 * 12
    # A line that goes nowhere is a dot.
    dot = shapes.ribbon(points[1:3], 0.1, 0.02, (0.0, 0.0, 1.0))
    np.testing.assert_allclose(np.ptp(dot.vertices, axis=0), [0.1, 0.1, 0.02], atol=1e-12)
