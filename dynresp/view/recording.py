"""The 3D recording: one HTML file with a time slider that opens without a network.

viser's browser client comes inside viser's wheel and is written into the file together with all
poses. viser has a server make the recording; it listens on this machine alone, on a port that the
system chooses, and is gone when the file is written.
"""

from __future__ import annotations

import contextlib
import html
import io
import itertools
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dynresp.support.errors import DynrespError
from dynresp.support.extras import require
from dynresp.support.files import replacing
from dynresp.view import body_shapes as shapes
from dynresp.view.body_shapes import PHASE_COLORS, Color, Mesh
from dynresp.view.scene_solids import SceneSolids
from dynresp.view.story import PHASE_NAMES, MovingCapsule, MovingSphere, PhaseName, Story, row_at
from dynresp.view.story_moments import camera_yaw

if TYPE_CHECKING:
    from viser import ViserServer

_HOST = "127.0.0.1"

# The browser may load nothing from elsewhere, whatever the page holds.
_ALONE = (
    '<meta http-equiv="Content-Security-Policy" '
    "content=\"default-src data: blob: 'unsafe-inline' 'unsafe-eval'\">"
)

# At most this many events are named in the heading.
_MOST_EVENTS = 6

# Lines on the ground are drawn this high above it [m], else the floor flickers through.
_ABOVE_FLOOR = 0.004


# Frames beyond this rate are left out [1/s].
_MAX_FPS = 60.0
# How long the last pose stands before the player starts again [s].
_HOLD_S = 1.0
# How much the clothes take the colour of the phase.
_DYE = 0.8
# The camera: how far ahead of the character's side, how far it looks down, its field of view [rad].
_TURN, _ELEVATION, _FIELD_OF_VIEW = np.radians(32.0), np.radians(13.0), np.radians(40.0)


def write_recording(story: Story, path: Path | str) -> None:
    """Write a story as a self-contained HTML page; the file is whole or not there.

    While it is made, what other threads print to standard output is lost: the server announces
    itself there, where results belong.

    Args:
        story: What is shown.
        path: The file; missing folders are made.

    Raises:
        DynrespError: The file cannot be written, or the machine allows no local server.
    """
    with _server() as server:
        scene = _Scene(server, story)
        recorder = server.get_scene_serializer()
        scene.play(recorder)
        page = recorder.as_html()
    with replacing(path) as temporary:
        temporary.write_text(_with_heading(page, story), encoding="utf-8")


@contextlib.contextmanager
def _server() -> Iterator[ViserServer]:
    """A viser server on a free port, silent, and stopped at the end."""
    require("viser")
    # viser would wait for ever for a server that cannot listen, so it is tried before.
    try:
        with socket.socket() as probe:
            probe.bind((_HOST, 0))
    except OSError as error:
        raise DynrespError(
            f"cannot make the recording: this machine does not let a program listen on {_HOST} "
            f"({error.strerror or error}), which viser needs for a moment; allow it or leave the "
            "recording out"
        ) from error
    import viser

    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=_HOST, port=0, verbose=False)
        try:
            yield server
        finally:
            server.stop()


class _Scene:
    """The story in the server's scene, frame by frame."""

    def __init__(self, server: ViserServer, story: Story) -> None:
        self.story = story
        self.solids = SceneSolids(story)
        self.scene = server.scene
        self._set_stage(server)
        self._character = self._add_character("/character", shapes.phase_colors(
            self.solids.solids, None, 0.0))  # fmt: skip
        self._others = [
            self._add_character(f"/other_{i}", shapes.other_colors(self.solids.solids, i))
            for i in range(len(story.others))
        ]
        self._things: list[tuple[MovingSphere | MovingCapsule, Any]] = []
        for i, ball in enumerate(story.spheres):
            mesh = shapes.sphere(ball.radius, shapes.BALL_COLOR)
            self._things.append((ball, self._add_mesh(f"/thing/{i}_{ball.name}", mesh)))
        for i, rod in enumerate(story.capsules):
            mesh = shapes.capsule(rod.radius, rod.half_length, shapes.CAPSULE_COLOR)
            self._things.append((rod, self._add_mesh(f"/limb/{i}_{rod.name}", mesh)))
        for i, mesh in enumerate((*self.solids.blocks(), *self.solids.edge())):
            self._add_mesh(f"/block/{i}", mesh)
        colors = itertools.cycle(shapes.PATH_COLORS)
        for i, (path, color) in enumerate(zip(story.paths, colors, strict=False)):
            points = np.column_stack([path.points, np.full(len(path.points), _ABOVE_FLOOR)])
            self.scene.add_line_segments(
                f"/path/{i}_{path.name}",
                np.stack([points[:-1], points[1:]], axis=1).astype(np.float32),
                colors=_bytes(color),
                thickness=3.0,
                thickness_units="screen",
            )
        self._label = self.scene.add_label(
            "/phase", " ", anchor="bottom-center", font_size_mode="screen", font_screen_scale=1.1
        )
        # Without text it would be an empty box above the head.
        self._label.visible = False
        self._phase: PhaseName | None = None

    def play(self, recorder: Any) -> None:
        """Show one frame after the other, with the time between them."""
        fps = self.story.motion.fps
        step = max(1, int(np.ceil(fps / _MAX_FPS)))
        frames = list(range(0, len(self.story.motion), step))
        for number, frame in enumerate(frames):
            if number:
                recorder.insert_sleep((frame - frames[number - 1]) / fps)
            self._put(frame)
        recorder.insert_sleep(_HOLD_S)

    def _put(self, frame: int) -> None:
        self._dress(self.story.phase_at(frame / self.story.motion.fps))
        _put_bodies(self._character, self.solids.states, frame)
        for bodies, states in zip(self._others, self.solids.others, strict=True):
            _put_bodies(bodies, states, min(frame, len(states.positions) - 1))
        for thing, handle in self._things:
            at = row_at(thing.positions, frame)
            handle.visible = at is not None
            if at is not None:
                handle.position = at
                if isinstance(thing, MovingCapsule):
                    handle.wxyz = thing.quaternions[frame]
        head = self.solids.states.centers[frame, self.solids.head]
        self._label.position = head + np.array([0.0, 0.0, 0.24])

    def _dress(self, phase: PhaseName | None) -> None:
        """Set the colours and the label when a phase begins."""
        if phase == self._phase:
            return
        self._phase = phase
        self._label.text = phase or " "
        self._label.visible = phase is not None
        colors = shapes.phase_colors(self.solids.solids, phase, _DYE)
        for (_, handle), color in zip(self._character, colors, strict=True):
            handle.color = _bytes(color)

    def _add_character(self, name: str, colors: list[Color]) -> list[tuple[int, Any]]:
        return [
            (solid.body, self._add_mesh(f"{name}/{solid.name}", solid.mesh, color))
            for solid, color in zip(self.solids.solids, colors, strict=True)
        ]

    def _add_mesh(self, name: str, mesh: Mesh, color: Color | None = None) -> Any:
        return self.scene.add_mesh_simple(
            name,
            mesh.vertices.astype(np.float32),
            mesh.faces.astype(np.uint32),
            color=_bytes(color or mesh.color),
        )

    def _set_stage(self, server: ViserServer) -> None:
        """Set floor, light and the camera, which sees the whole path."""
        low, high = self.solids.bounds()
        middle = 0.5 * (low + high)
        middle[2] = 0.85
        size = float(np.ceil(np.linalg.norm((high - low)[:2]) + 8.0))
        self.scene.set_up_direction("+z")
        self.scene.configure_environment_map("studio", environment_intensity=0.18)
        self.scene.add_grid(
            "/floor", size, size, position=(round(middle[0]), round(middle[1]), 0.0),
            cell_size=0.5, section_size=1.0, cell_color=(222, 226, 230),
            section_color=(190, 197, 204), shadow_opacity=0.3, plane_color=(243, 245, 247),
            plane_opacity=1.0,
        )  # fmt: skip
        yaw = camera_yaw(self.story, float(_TURN))
        right = np.array([np.sin(yaw), -np.cos(yaw)])
        points = np.concatenate(
            [s.positions.reshape(-1, 3) for s in (self.solids.states, *self.solids.others)]
        )
        across = (points[:, :2] - middle[:2]) @ right
        half = float(np.abs(across).max()) + 0.9
        # Wide enough for the path in a window of 4:3, high enough for a person with a raised arm.
        tangent = np.tan(0.5 * _FIELD_OF_VIEW)
        distance = max(half / (4 / 3 * tangent), 1.5 / tangent)
        down = _ELEVATION
        back = np.array([-np.cos(yaw), -np.sin(yaw)]) * np.cos(down) * distance
        camera = server.initial_camera
        camera.fov = float(_FIELD_OF_VIEW)
        camera.look_at = middle
        camera.position = middle + np.array([*back, np.sin(down) * distance])


def _with_heading(page: str, story: Story) -> str:
    """The page with a title, a list of events, and a ban on loading anything from elsewhere."""
    shown = [name for name in PHASE_NAMES if any(phase.name == name for phase in story.phases)]
    chips = "".join(
        f'<span style="margin-left:1.1em"><span style="color:rgb{_bytes(PHASE_COLORS[name])}">'
        f"&#9679;</span> {name}</span>"
        for name in shown
    )
    events_shown = sorted(story.events, key=lambda event: event.time_s)
    more = len(events_shown) - _MOST_EVENTS
    events = " &middot; ".join(
        f"{event.time_s:.2f} s {html.escape(event.name)}" for event in events_shown[:_MOST_EVENTS]
    ) + (f" and {more} more" if more > 0 else "")
    lines = [
        f'<div style="font-size:17px;font-weight:600">{html.escape(story.title)}</div>',
        f'<div style="color:#667">{html.escape(story.subtitle)}</div>' if story.subtitle else "",
        f'<div style="color:#445">{events}</div>' if events else "",
        f"<div>{chips}</div>" if chips else "",
    ]
    heading = (
        '<div style="position:fixed;top:12px;right:16px;z-index:3;pointer-events:none;'
        "text-align:right;max-width:55vw;font:13px/1.5 system-ui,sans-serif;color:#223;"
        "text-shadow:0 0 4px #fff,0 0 4px #fff"
        f'">{"".join(lines)}</div>'
    )
    title = html.escape(story.title or "dynresp")
    page = page.replace("<title>Viser</title>", f"<title>{title}</title>", 1)
    page = page.replace("<head>", f"<head>{_ALONE}", 1)
    body_end = page.rindex("</body>")
    return page[:body_end] + heading + page[body_end:]


def _put_bodies(bodies: list[tuple[int, Any]], states: Any, frame: int) -> None:
    for body, handle in bodies:
        handle.position = states.positions[frame, body]
        handle.wxyz = states.quaternions[frame, body]


def _bytes(color: Color) -> tuple[int, int, int]:
    red, green, blue = (round(255 * x) for x in color)
    return red, green, blue
