"""Built-in motions, which dynresp makes itself from key poses, in place of motion capture.

`reactions/builtin/` holds them as TOML files. A file is read and checked (`keypose_spec`,
`course_spec`), its keys become curves and poses (`keyposes`, `steady_walk` for the walk), and the
feet are fixed where they stand (`footing`). A course is planned step by step first (`course_plan`),
and balance moves the body over its feet (`course`).
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
