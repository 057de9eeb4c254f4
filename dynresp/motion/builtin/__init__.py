"""Motions that this project makes itself from key poses; they stand in for motion capture.

`reactions/builtin/` holds them as TOML files. The way of the data: a file is read and checked
(`keypose_spec`, `course_spec`), its keys become curves and poses (`keyposes`, `gait` for the walk),
and the feet are locked where they stand (`footing`). A course is planned step by step first
(`course_plan`), and balance moves the body over its feet (`course`).
"""

from dynresp.motion.builtin.builtin_motions import (
    FLAT,
    PREFIX,
    BuiltinInfo,
    builtin_folder,
    builtin_info,
    builtin_names,
    load_builtin,
    make_motion,
    make_poses,
)

__all__ = [
    "FLAT",
    "PREFIX",
    "BuiltinInfo",
    "builtin_folder",
    "builtin_info",
    "builtin_names",
    "load_builtin",
    "make_motion",
    "make_poses",
]
