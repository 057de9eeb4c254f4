"""Optional packages: which extra installs each, and an error that names it where one is missing.

`pip install dynresp` installs what hits and result files need. The other packages come with extras,
such as `pip install 'dynresp[view]'`. Code that needs one imports it inside a function, after a
call of `require`.
"""

from __future__ import annotations

import importlib

from dynresp.support.errors import MissingExtraError

EXTRAS = {
    "cv2": ("OpenCV", "camera"),
    "distributed": ("Dask", "cluster"),
    "imageio_ffmpeg": ("imageio-ffmpeg", "view"),
    "matplotlib": ("Matplotlib", "view"),
    "pyarrow": ("PyArrow", "data"),
    "skops": ("skops", "learn"),
    "sklearn": ("scikit-learn", "learn"),
    "viser": ("viser", "view"),
}
"""For each optional module its package's name in messages, and the extra that installs it."""


def require(*modules: str) -> None:
    """Import optional modules, so that the imports that follow succeed.

    Args:
        modules: Keys of `EXTRAS`.

    Raises:
        MissingExtraError: Some are not installed, or cannot be imported; the message names them
            and the command that installs them all.
    """
    problems, extras = [], set()
    for module in modules:
        name, extra = EXTRAS[module]
        try:
            importlib.import_module(module)
        except ImportError as error:
            absent = isinstance(error, ModuleNotFoundError) and error.name == module
            problems.append(f"{name} {'is not installed' if absent else f'cannot load ({error})'}")
            extras.add(extra)
    if problems:
        raise MissingExtraError(
            f"{', '.join(problems)}; run `pip install 'dynresp[{','.join(sorted(extras))}]'` and "
            "try again"
        )
