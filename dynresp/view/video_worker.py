"""Draw a video in a separate process: `python -m dynresp.view.video_worker SCRIPT.npz OUT.mp4`.

`dynresp.view.video_writer` starts it with `MUJOCO_GL` set, since MuJoCo reads that once, on import.
A line on standard output that begins with `PROGRESS` is frames done and frames in all, others are
of drivers and mean nothing; why it failed is the last line on standard error.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from dynresp.support import paths
from dynresp.support.extras import require

PROGRESS = "dynresp-video"
"""First word of a line that reports progress."""

# Frames between two lines on standard output.
_REPORT_EVERY = 5
# Side of the shadow map in pixels. Half of it makes shadows ragged, twice of it costs a fifth more
# time without a graphics card.
_SHADOW_SIZE = 1024
# The lamp: distance from what the camera looks at [m], half angles that it lights and within which
# things throw shadows (about 4.5 m around) [degrees].
_LAMP_DISTANCE, _LIT_DEG, _SHADOWED_DEG = 12.0, 85.0, 21.0
# Size of the scene for MuJoCo [m]; haze begins at a few times this.
_EXTENT = 4.0


def main(script_file: str, video_file: str) -> None:
    """Draw what a script says.

    Args:
        script_file: An .npz file as `dynresp.view.video_writer` makes it.
        video_file: The MP4 to write.
    """
    require("imageio_ffmpeg")
    import imageio_ffmpeg
    import mujoco

    with np.load(script_file, allow_pickle=False) as file:
        script = dict(file)
    width, height = (int(n) for n in script["size"])
    model = _model(mujoco, script, width, height)
    data = mujoco.MjData(model)
    camera = mujoco.MjvCamera()
    camera.azimuth, camera.elevation, camera.distance = (float(x) for x in script["view"])
    # A light's shadow reaches only so far, so it goes along with the camera.
    lights = model.light_pos.copy()
    total = len(script["poses"])
    ground = model.geom("floor").id
    solids = np.flatnonzero(np.arange(model.ngeom) != ground)
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = True
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        film = imageio_ffmpeg.write_frames(
            video_file,
            (width, height),
            fps=float(script["fps"]),
            codec="libx264",
            pix_fmt_out="yuv420p",
            macro_block_size=2,
            output_params=["-crf", str(int(script["quality"])), "-preset", "veryfast",
                           "-movflags", "+faststart"],
            ffmpeg_log_level="error",
        )  # fmt: skip
        film.send(None)
        try:
            for number in range(total):
                poses = script["poses"][number]
                absent = np.isnan(poses[:, 0])
                data.mocap_pos[:] = np.where(absent[:, None], 0.0, poses[:, :3])
                data.mocap_quat[:] = poses[:, 3:]
                model.geom_rgba[solids, :3] = script["colors"][number]
                model.geom_rgba[solids, 3] = ~absent
                model.light_pos[:, :2] = lights[:, :2] + script["target"][number][:2]
                mujoco.mj_kinematics(model, data)
                mujoco.mj_camlight(model, data)
                camera.lookat[:] = script["target"][number]
                renderer.update_scene(data, camera)
                film.send(np.ascontiguousarray(renderer.render()))
                if (number + 1) % _REPORT_EVERY == 0 or number + 1 == total:
                    print(PROGRESS, number + 1, total, flush=True)
        finally:
            film.close()


def _model(mujoco: Any, script: Mapping[str, npt.NDArray[Any]], width: int, height: int) -> Any:
    """The scene with one movable body for each solid."""
    spec = mujoco.MjSpec.from_file(str(paths.models_folder() / "scene.xml"))
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.quality.shadowsize = _SHADOW_SIZE
    # A high lamp behind the camera's left shoulder; a directional light would leave specks where
    # its shadow map ends on the floor.
    azimuth = np.radians(float(script["view"][0]))
    ahead, right = (np.array([np.cos(a), np.sin(a), 0.0]) for a in (azimuth, azimuth - 0.5 * np.pi))
    aim = 0.45 * right + 0.40 * ahead + np.array([0.0, 0.0, -0.80])
    for light in spec.lights:
        light.type = mujoco.mjtLightType.mjLIGHT_SPOT
        light.cutoff, light.exponent = _LIT_DEG, 0.0
        light.dir = aim
        light.pos = -_LAMP_DISTANCE * aim
        light.castshadow = True
    spec.visual.map.shadowscale = _SHADOWED_DEG / _LIT_DEG
    spec.stat.extent = _EXTENT
    vertices = np.split(script["vertices"], np.cumsum(script["vertex_counts"])[:-1])
    faces = np.split(script["faces"], np.cumsum(script["face_counts"])[:-1])
    for number, (points, triangles) in enumerate(zip(vertices, faces, strict=True)):
        name = f"solid{number}"
        mesh = spec.add_mesh(name=name)
        mesh.uservert = points.ravel().tolist()
        mesh.userface = triangles.ravel().tolist()
        mesh.smoothnormal = True
        body = spec.worldbody.add_body(name=name, mocap=True)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0)
    return spec.compile()


if __name__ == "__main__":
    main(*(str(Path(word)) for word in sys.argv[1:3]))
