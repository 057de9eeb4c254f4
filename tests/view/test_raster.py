from __future__ import annotations

import numpy as np

from dynresp.view import body_shapes as shapes
from dynresp.view import raster

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
RED, GREEN = (0.9, 0.1, 0.1), (0.1, 0.9, 0.1)


def ball(radius: float, at: tuple[float, float, float], color: shapes.Color) -> shapes.Mesh:
    return shapes.sphere(radius, color).placed(np.array(at), UPRIGHT)


def test_axes_of_a_camera() -> None:
    view = raster.Projection.looking(0.7, 0.3)
    axes = np.stack([view.right, view.up, view.towards])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    # Looking along +X, the left (+Y) of the world is left in the picture, and up is up.
    x, y, _ = raster.Projection.looking(0.0, 0.0).screen([0.0, 1.0, 2.0])
    assert (x, y) == (-1.0, 2.0)


def test_a_ball_covers_a_disc_in_its_place() -> None:
    view = raster.Projection.looking(0.0, 0.2)
    pixel = 0.005
    layer = raster.draw([ball(0.2, (3.0, -1.0, 0.5), RED)], view, pixel)
    cover = layer.rgba[..., 3]
    assert abs(cover.sum() * pixel**2 / (np.pi * 0.2**2) - 1) < 0.01
    rows, columns = np.indices(cover.shape)
    x = layer.left + (columns * cover).sum() / cover.sum() + 0.5
    y = layer.top - (rows * cover).sum() / cover.sum() - 0.5
    np.testing.assert_allclose(
        np.array([x, y]) * pixel, view.screen([3.0, -1.0, 0.5])[:2], atol=pixel
    )


def test_the_nearer_hides_the_farther() -> None:
    view = raster.Projection.looking(0.0, 0.0)
    near, far = ball(0.1, (0.0, 0.0, 0.0), RED), ball(0.2, (1.0, 0.0, 0.0), GREEN)
    for order in ([near, far], [far, near]):
        layer = raster.draw(order, view, 0.01)
        middle = layer.rgba[len(layer.rgba) // 2, layer.rgba.shape[1] // 2]
        assert middle[0] > 3 * middle[1]
        side = layer.rgba[len(layer.rgba) // 2, 5]
        assert side[1] > 3 * side[0]


def test_shadows_lie_below_and_fade_with_height() -> None:
    low = raster.floor_shadow([ball(0.1, (0.0, 0.0, 0.1), RED)], 0.0, 0.3, 0.01)
    high = raster.floor_shadow([ball(0.1, (0.0, 0.0, 1.5), RED)], 0.0, 0.3, 0.01)
    assert low.rgba[..., 3].max() > 2 * high.rgba[..., 3].max() > 0
    assert not low.rgba[..., :3].any()
    row, column = np.unravel_index(np.argmax(low.rgba[..., 3]), low.rgba.shape[:2])
    assert abs(low.left + column) <= 2
    assert abs(low.top - row) <= 2


def test_only_what_is_on_the_canvas_is_drawn() -> None:
    view, pixel = raster.Projection.looking(0.2, 0.3), 0.01
    meshes = [ball(0.3, (0.0, 0.0, 0.0), RED), ball(0.2, (0.1, 0.2, 0.3), GREEN)]
    whole, cut = (raster.Canvas(left=-10, top=20, width=25, height=30) for _ in range(2))
    whole.paste(raster.draw(meshes, view, pixel))
    cut.paste(raster.draw(meshes, view, pixel, canvas=cut))
    np.testing.assert_allclose(cut.rgba, whole.rgba, atol=1e-6)
    # A world without end costs no memory, and what is beside the canvas is left out.
    huge = [shapes.box((1e5, 1e5, 0.1), RED), *meshes]
    assert raster.draw(huge, view, pixel, canvas=cut).rgba.shape == (30, 25, 4)
    away = raster.draw([ball(0.1, (0.0, 50.0, 0.0), RED)], view, pixel, canvas=cut)
    assert away.rgba.size == 0
    cut.paste(away)
    np.testing.assert_allclose(cut.rgba, whole.rgba, atol=1e-6)


def test_layers_are_cut_at_the_edges_of_a_canvas() -> None:
    layer = raster.Layer(np.full((4, 4, 4), 0.5), left=-2, top=2)
    canvas = raster.Canvas(left=0, top=10, width=5, height=10)
    canvas.paste(layer)
    assert canvas.rgba[8:, :2, 3].tolist() == [[0.5, 0.5], [0.5, 0.5]]
    assert canvas.rgba[..., 3].sum() == 2.0
    canvas.paste(layer, right=50)
    canvas.paste(layer, up=50)
    canvas.paste(layer, right=-50, up=-50)
    assert canvas.rgba[..., 3].sum() == 2.0
    # Half of a half over a half.
    canvas.paste(layer, alpha=0.5)
    assert canvas.rgba[9, 0, 3] == 0.25 + 0.75 * 0.5
    assert canvas.picture()[9, 0].tolist() == [255, 255, 255, 159]
    assert canvas.picture()[0, 0].tolist() == [0, 0, 0, 0]
