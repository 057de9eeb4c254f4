"""Reads and writes classifier files (`.skops`), without skops and scikit-learn to predict.

A `.skops` file is a zip archive. A classifier's file holds what `skops.io.dump` writes of the two
scikit-learn pipelines, and the compiled predictors with all that is known of them:

==========================  ======================================================================
member                      what it holds
==========================  ======================================================================
``schema.json``, ``*.npy``  the pipelines, by skops: a dictionary of ``exact`` and ``reduced``
``classifier.json``         classes, members, features, identities, settings, measured facts
``exact.projection.npy``    (k, F) float64; with ``exact.offset.npy`` (k,) float64 and
                            ``exact.weights.npy`` (pairs, monomials) float64 or float32 what
                            `compiled_classifier.PairwiseQuadratic` says
``reduced.*.npy``           the same of the reduced model
==========================  ======================================================================

So `skops.io.load` opens it as usual, while dynresp reads only the arrays: that takes milliseconds,
and importing scikit-learn and skops two seconds. Nothing is unpickled. Pipelines and predictors are
written together and never changed; each member has its checksum. The pipelines can be left out:
their support vectors are training samples, which may be under a licence, and most of the file.
"""

from __future__ import annotations

import io
import json
import os
import struct
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from dynresp.response.prediction.classifier import (
    Classifier,
    ClassifierError,
    TrainedFor,
    TrainedOn,
)
from dynresp.response.prediction.compiled_classifier import PairwiseQuadratic
from dynresp.response.prediction.hit_features import identity as features_identity
from dynresp.support.errors import DynrespError
from dynresp.support.extras import require
from dynresp.support.files import replacing
from dynresp.support.inputs import open_input

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline

FORMAT, FORMAT_VERSION = "dynresp classifier", 2
SUFFIX = ".skops"
MODELS = ("exact", "reduced")
"""Names of the two models, in the file and as attributes of `Classifier`."""

MAX_FILE_BYTES = 2 << 30
"""Largest file that is opened."""
MAX_ARRAY_BYTES = 1 << 30
"""Largest array of a compiled predictor."""
MAX_CLASSES, MAX_COMPONENTS = 2_000, 1_000

_ABOUT = "classifier.json"
_SCHEMA = "schema.json"
_MAX_TEXT_BYTES = 16 << 20
_MAX_HEADER_BYTES = 1_000
_MAX_DIRECTORY_BYTES = 1 << 20
_ARRAYS = ("projection", "offset", "weights")
_ZIP_END = struct.Struct("<4s4H2LH")
# The only types in a classifier's pipelines. skops by itself would trust many more.
_TRUSTED = {
    ("builtins", "dict"),
    ("builtins", "list"),
    ("builtins", "tuple"),
    ("builtins", "str"),
    ("numpy", "ndarray"),
    ("numpy", "float64"),
    ("numpy", "int64"),
    ("sklearn.decomposition._pca", "PCA"),
    ("sklearn.pipeline", "Pipeline"),
    ("sklearn.preprocessing._data", "StandardScaler"),
    ("sklearn.svm._classes", "SVC"),
}


def save_classifier(
    path: Path | str, classifier: Classifier, pipelines: Mapping[str, Pipeline] | None
) -> None:
    """Write a classifier.

    Args:
        path: The file; missing folders are made.
        classifier: The classifier.
        pipelines: The scikit-learn pipelines that it was compiled from, by name: "exact" and
            "reduced". None leaves them out.

    Raises:
        DynrespError: The file cannot be written.
    """
    data = io.BytesIO()
    if pipelines is not None:
        require("skops")
        import skops.io

        data = io.BytesIO(skops.io.dumps({name: pipelines[name] for name in MODELS}))
    with zipfile.ZipFile(data, "a") as archive:
        archive.writestr(_ABOUT, json.dumps(_about(classifier), indent=1, allow_nan=False))
        for model in MODELS:
            predictor = getattr(classifier, model)
            for name in _ARRAYS:
                with archive.open(f"{model}.{name}.npy", "w") as member:
                    np.lib.format.write_array(
                        member, getattr(predictor, name), version=(1, 0), allow_pickle=False
                    )
    with replacing(path) as temporary:
        temporary.write_bytes(data.getbuffer())


def load_classifier(path: Path | str) -> Classifier:
    """Read a classifier, without skops and scikit-learn.

    Sizes are checked before anything is unpacked.

    Raises:
        ClassifierError: The file cannot be read, is damaged or too large, or was written by
            another version; the message names it.
    """
    with _opened(Path(path)) as archive:
        about = _read_about(archive)
        compiled = {model: _read_predictor(archive, model, about) for model in MODELS}
        return Classifier(
            grouping=about["grouping"],
            classes=_texts(about, "classes"),
            members=tuple(tuple(_text(name) for name in own) for own in about["members"]),
            absent=_texts(about, "absent"),
            feature_names=_texts(about, "features"),
            trained_for=TrainedFor(**{k: _text(v) for k, v in about["trained_for"].items()}),
            trained_on=_trained_on(about["trained_on"]),
            settings=_table(about, "settings"),
            exact=compiled["exact"],
            reduced=compiled["reduced"],
            facts=_facts(about),
        )


def load_pipelines(path: Path | str) -> dict[str, Pipeline]:
    """Read the scikit-learn pipelines of a classifier.

    Returns:
        "exact" and "reduced"; each takes the features named in `Classifier.feature_names` and
        predicts indices of the classes of its training.

    Raises:
        ClassifierError: The file cannot be read, is damaged, or holds other objects.
    """
    require("skops", "sklearn")
    path = Path(path)
    with _opened(path) as archive:
        _read_about(archive)
        if _SCHEMA not in archive.namelist():
            raise ClassifierError(
                "holds the compiled models alone, without their pipelines; train it again with "
                "`dynresp train`, without --compiled-only"
            )
        others = _types(json.loads(_text_of(archive, _SCHEMA))) - _TRUSTED
        if others:
            named = ", ".join(sorted(".".join(kind) for kind in others)[:5])
            raise ClassifierError(
                f"it holds objects that do not belong to a classifier ({named}); it is not opened"
            )
        import skops.io
        from sklearn.pipeline import Pipeline

        found = skops.io.load(path, trusted=[])
        if not isinstance(found, dict) or found.keys() != set(MODELS):
            raise ValueError(f"not a dictionary of {' and '.join(MODELS)}")
        if not all(isinstance(pipeline, Pipeline) for pipeline in found.values()):
            raise ValueError("not pipelines")
        for model, pipeline in found.items():
            _check_same(archive, model, PairwiseQuadratic.from_pipeline(pipeline))
        return found


# -- the file ---------------------------------------------------------------------------------


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open the archive while the block runs; every error names the file."""
    try:
        if not path.is_file():
            what = "is a folder" if path.is_dir() else "no such file"
            raise ClassifierError(f"{what}; expected what `dynresp train` has written")
        with open_input(path) as file:
            _check_archive(file)
            with zipfile.ZipFile(file) as archive:
                if sum(member.file_size for member in archive.infolist()) > MAX_FILE_BYTES:
                    raise ClassifierError("is too large when unpacked for a classifier")
                yield archive
    except ClassifierError as error:
        raise ClassifierError(f"{path}: {error}") from error.__cause__
    # On damaged files zipfile, zlib, json, NumPy and skops raise dozens of kinds of errors.
    except Exception as error:
        reason = (
            str(error) if isinstance(error, DynrespError) else f"{type(error).__name__}: {error}"
        )
        raise ClassifierError(
            f"{path}: damaged, or not a classifier ({reason[:300]}); train it again with "
            "`dynresp train`"
        ) from error


def _check_archive(file: io.BufferedReader) -> None:
    """Refuse what is too large, before the zip library reads its directory."""
    size = file.seek(0, os.SEEK_END)
    if size > MAX_FILE_BYTES:
        raise ClassifierError(f"has {size} bytes; a classifier has at most {MAX_FILE_BYTES}")
    file.seek(-min(size, _ZIP_END.size), os.SEEK_END)
    end = file.read()
    if len(end) < _ZIP_END.size or not end.startswith(b"PK\x05\x06"):
        raise ClassifierError(
            "not a .skops file, or cut short: the end of the zip archive is missing"
        )
    if _ZIP_END.unpack(end)[5] > _MAX_DIRECTORY_BYTES:
        raise ClassifierError("an archive of more files than a classifier has")


def _about(classifier: Classifier) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "grouping": classifier.grouping,
        "classes": classifier.classes,
        "members": classifier.members,
        "absent": classifier.absent,
        "features": classifier.feature_names,
        "features_identity": features_identity(),
        "trained_for": asdict(classifier.trained_for),
        "trained_on": asdict(classifier.trained_on),
        "components": {model: len(getattr(classifier, model).offset) for model in MODELS},
        "settings": classifier.settings,
        "facts": classifier.facts,
    }


def _read_about(archive: zipfile.ZipFile) -> dict[str, Any]:
    if _ABOUT not in archive.namelist():
        raise ClassifierError(f"not a classifier of dynresp (it has no {_ABOUT})")
    about = json.loads(_text_of(archive, _ABOUT))
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise ClassifierError(f"not a classifier of dynresp ({_ABOUT} does not say that it is one)")
    if about.get("format_version") != FORMAT_VERSION:
        raise ClassifierError(
            f"has format version {about.get('format_version')!r:.50}, and this dynresp reads "
            f"{FORMAT_VERSION}; train it again with `dynresp train`"
        )
    if about.get("features_identity") != features_identity():
        raise ClassifierError(
            "was trained on other features than this version of dynresp computes; make the dataset "
            "again with `dynresp generate`, then train with `dynresp train`"
        )
    return about


def _text_of(archive: zipfile.ZipFile, name: str) -> str:
    if archive.getinfo(name).file_size > _MAX_TEXT_BYTES:
        raise ValueError(f"{name} is larger than {_MAX_TEXT_BYTES} bytes")
    return archive.read(name).decode("utf-8")


def _read_predictor(
    archive: zipfile.ZipFile, model: str, about: Mapping[str, Any]
) -> PairwiseQuadratic:
    """Read a compiled predictor; its arrays must have the shapes for the classes and features."""
    classes, features = len(_texts(about, "classes")), len(_texts(about, "features"))
    k = about["components"][model]
    if not 2 <= classes <= MAX_CLASSES:
        raise ValueError(f"{classes} classes, expected 2 to {MAX_CLASSES}")
    if type(k) is not int or not 1 <= k <= MAX_COMPONENTS:
        raise ValueError(f"{k!r} components, expected 1 to {MAX_COMPONENTS}")
    shapes = {
        "projection": (k, features),
        "offset": (k,),
        "weights": (classes * (classes - 1) // 2, 1 + k + k * (k + 1) // 2),
    }
    arrays: dict[str, Any] = {
        name: _array(archive, f"{model}.{name}.npy", shapes[name]) for name in _ARRAYS
    }
    return PairwiseQuadratic(**arrays, classes=classes)


def _array(archive: zipfile.ZipFile, name: str, shape: tuple[int, ...]) -> npt.NDArray[np.floating]:
    """Read an array of this shape; only `weights` may have single precision."""
    types = ("<f4", "<f8") if ".weights" in name else ("<f8",)
    info = archive.getinfo(name)
    with archive.open(info) as member:
        if np.lib.format.read_magic(member) != (1, 0):
            raise ValueError(f"{name} is not a .npy array of version 1.0")
        found, fortran, dtype = np.lib.format.read_array_header_1_0(
            member, max_header_size=_MAX_HEADER_BYTES
        )
        if found != shape or fortran or dtype.str not in types:
            raise ValueError(f"{name} is {dtype.str} {found}, expected {types[-1]} {shape}")
        size = int(np.prod(shape, dtype=object)) * dtype.itemsize
        if size > min(MAX_ARRAY_BYTES, info.file_size):
            raise ValueError(f"{name} has {info.file_size} bytes, its shape {shape} needs {size}")
        data = member.read(size)
        # Reading to the end also checks the checksum.
        if len(data) != size or member.read(1):
            raise ValueError(f"{name} has another size than {shape} needs")
    return np.frombuffer(data, dtype=dtype).reshape(shape)


def _types(node: Any) -> set[tuple[str, str]]:
    """All types of which a skops schema would make objects."""
    if isinstance(node, list):
        return set().union(*(_types(item) for item in node))
    if not isinstance(node, dict):
        return set()
    found = set().union(*(_types(item) for item in node.values()))
    if "__class__" in node or "__module__" in node or "__loader__" in node:
        found.add((str(node.get("__module__")), str(node.get("__class__"))))
    return found


def _check_same(archive: zipfile.ZipFile, model: str, compiled: PairwiseQuadratic) -> None:
    """Refuse pipelines from which the predictor was not compiled."""
    for name in _ARRAYS:
        wanted = np.asarray(getattr(compiled, name))
        stored = _array(archive, f"{model}.{name}.npy", wanted.shape)
        largest = float(np.abs(wanted).max())
        if not np.allclose(stored, wanted, rtol=1e-5, atol=1e-6 * largest):
            raise ValueError(f"{model}.{name} belongs to another pipeline")


def _trained_on(table: Mapping[str, Any]) -> TrainedOn:
    found = TrainedOn(**table)
    _text(found.dataset)
    whole = (found.count, found.samples, found.seed)
    if any(type(n) is not int or n < 0 for n in whole) or not 0.0 <= found.held_out < 1.0:
        raise ValueError("trained_on holds wrong numbers")
    if found.limit is not None and type(found.limit) is not int:
        raise ValueError("limit must be a whole number")
    return found


def _texts(table: Mapping[str, Any], key: str) -> tuple[str, ...]:
    return tuple(_text(item) for item in table[key])


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f"expected text, got {value!r:.50}")
    return value


def _table(table: Mapping[str, Any], key: str) -> dict[str, Any]:
    found = table[key]
    if not isinstance(found, dict):
        raise ValueError(f"{key} is not a table")
    return found


def _facts(table: Mapping[str, Any]) -> dict[str, Any]:
    """Measured facts; those that an evaluation repeats must be there."""
    facts = _table(table, "facts")
    _text(facts["vector"])
    if not all(type(slice_s) in (int, float) for slice_s in facts["slices_s"]):
        raise ValueError("slices_s must be numbers")
    if not all(type(count) is int for count in _table(facts, "samples_per_class").values()):
        raise ValueError("samples_per_class must be whole numbers")
    return facts
