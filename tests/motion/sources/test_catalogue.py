import hashlib
import os
from pathlib import Path

import pytest

from dynresp.motion.sources import catalogue, collection
from dynresp.motion.sources.motion_folders import find_motion_file, list_motion_files
from dynresp.support.errors import SpecError, UnknownNameError

LICENCES = {"o/r": catalogue.Licence("o/r", "MIT", "MIT License", "by o", "keep it", "http://o")}
HEADER = "kind,file,source_repo,commit,original_path,licence,bytes,sha256,fps,unit_m,skeleton"
CLIP = {
    "kind": "clip",
    "file": "d/a.bvh",
    "source_repo": "o/r",
    "commit": "0" * 40,
    "original_path": "data/a b.bvh",
    "licence": "MIT",
    "bytes": "12",
    "sha256": "a" * 64,
    "fps": "30",
    "unit_m": "0.01",
    "skeleton": "",
}
AMC = CLIP | {"file": "d/b.amc", "skeleton": "d/s.asf"}
SKELETON = CLIP | {"kind": "skeleton", "file": "d/s.asf", "fps": ""}
LICENCE_TEXT = CLIP | {"kind": "licence", "file": "d/LICENSE", "fps": "", "unit_m": ""}


def _table(folder: Path, *rows: dict[str, str]) -> Path:
    path = folder / "sources.csv"
    path.write_text("\n".join([HEADER, *(",".join(row.values()) for row in rows)]) + "\n")
    return path


def _load(folder: Path, *rows: dict[str, str]) -> dict[str, catalogue.SourceFile]:
    return catalogue.load_sources(_table(folder, *rows), LICENCES)


def test_rows_are_read(tmp_path: Path) -> None:
    sources = _load(tmp_path, AMC, SKELETON, LICENCE_TEXT)
    clip = sources["d/b.amc"]
    assert (clip.size, clip.fps, clip.unit_m, clip.skeleton) == (12, 30.0, 0.01, "d/s.asf")
    assert sources["d/s.asf"].fps is None
    assert sources["d/LICENSE"].unit_m is None


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("kind", "film", r"kind is 'film'; expected one of clip"),
        ("file", "../a.bvh", r"'../a.bvh' is not a path inside"),
        ("original_path", "/a.bvh", r"'/a.bvh' is not a path inside"),
        ("source_repo", "only-a-name", r"expected owner/name"),
        ("source_repo", "o/other", r"licence table does not state that for o/other"),
        ("licence", "GPL-3.0", r"licence is 'GPL-3.0'"),
        ("commit", "main", r"commit is 'main'; expected 40 hexadecimal"),
        ("sha256", "A" * 64, r"sha256 is .* expected 64 hexadecimal"),
        ("bytes", "0", r"bytes is '0'; expected a number above 0"),
        ("bytes", "12.5", r"bytes is '12.5'"),
        ("bytes", str(1 << 40), r"at most"),
        ("fps", "nan", r"fps is 'nan'"),
        ("fps", "", r"fps is ''"),
        ("unit_m", "inf", r"unit_m is 'inf'"),
        ("skeleton", "d/s.asf", r"AMC clips need one, others have none"),
    ],
)
def test_wrong_values_name_line_and_column(
    column: str, value: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(SpecError, match=message) as caught:
        _load(tmp_path, SKELETON, CLIP | {column: value})
    assert "line 3" in str(caught.value)


def test_wrong_tables_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="there twice"):
        _load(tmp_path, CLIP, CLIP)
    with pytest.raises(SpecError, match="no row of kind 'skeleton'"):
        _load(tmp_path, AMC)
    with pytest.raises(SpecError, match="AMC clips need one"):
        _load(tmp_path, AMC | {"skeleton": ""})
    with pytest.raises(SpecError, match="cannot be read"):
        catalogue.load_sources(tmp_path / "nowhere.csv", LICENCES)
    path = tmp_path / "sources.csv"
    for content, message in [
        (b"", "the columns are"),
        (b"a,b\n", "the columns are a, b; expected kind"),
        (HEADER.encode() + b"\nclip,x\n", "line 2: 2 values"),
        (HEADER.encode() + b"\n\xff\xfe\n", "cannot be read"),
        (HEADER.encode() + b'\n"clip\n', "cannot be read"),
    ]:
        path.write_bytes(content)
        with pytest.raises(SpecError, match=message):
            catalogue.load_sources(path, LICENCES)


def test_wrong_licence_tables_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "licences.csv"
    header = "source_repo,licence,name,credit,terms,url\n"
    path.write_text(header + "o/r,MIT,n,c,t,u\no/r,MIT,n,c,t,u\n")
    with pytest.raises(SpecError, match=r"line 3: 'o/r' is there twice"):
        catalogue.load_licences(path)
    path.write_text(header + "o/r,MIT,n,,t,u\n")
    with pytest.raises(SpecError, match="line 2: every column needs a value"):
        catalogue.load_licences(path)


def test_shipped_tables_hold_together() -> None:
    sources, licences = catalogue.load_sources(), catalogue.load_licences()
    kinds = [source.kind for source in sources.values()]
    assert kinds.count("clip") == 269
    assert list(sources) == sorted(sources)
    assert set(licences) == {source.source_repo for source in sources.values()}
    folded = {file.casefold() for file in sources}
    assert len(folded) == len(sources), "two files would be one where case does not count"


def test_licences_of_files() -> None:
    sources = catalogue.load_sources()
    some = [sources["cmu/16/16_08.amc"], sources["cmu/16/16_11.amc"]]
    (cmu,) = catalogue.licences_of(some)
    assert cmu.spdx == "LicenseRef-CMU-Mocap"
    assert "NSF EIA-0196217" in cmu.credit
    assert catalogue.licences_of([]) == []


def _libraries(folder: Path, core: str, example: str = "", full: str = "") -> dict[str, Path]:
    reactions, examples = folder / "reactions", folder / "examples"
    reactions.mkdir()
    examples.mkdir()
    (reactions / "core.toml").write_text(core)
    (reactions / "full.toml").write_text(full)
    (examples / "one.toml").write_text(example)
    return {"reactions": reactions, "examples": examples}


def test_collections_hold_what_the_libraries_name(tmp_path: Path) -> None:
    other = CLIP | {"file": "e/c.bvh"}
    unused = CLIP | {"file": "e/unused.bvh"}
    sources = _load(tmp_path, CLIP, AMC, SKELETON, other, unused, LICENCE_TEXT)
    folders = _libraries(
        tmp_path,
        core='[[reaction]]\nname = "x.bvh"\nfile = "d/b.amc"\n[[reaction]]\nfile = "built-in"\n',
        example='[base]\nmotion = "built-in walk"\n[[deep.list]]\nmotion = "e/c.bvh"\n',
        full='[[reaction]]\nfile = "d/a.bvh"\n',
    )

    def names(name: str) -> list[str]:
        return [s.file for s in collection.collection_files(name, sources, **folders)]

    assert names("core") == ["d/LICENSE", "d/b.amc", "d/s.asf", "e/c.bvh"]
    assert names("full") == ["d/LICENSE", "d/a.bvh", "d/b.amc", "d/s.asf", "e/c.bvh"]
    assert names("all") == sorted(sources)


def test_table_under_a_key_is_looked_into(tmp_path: Path) -> None:
    library = tmp_path / "library.toml"
    library.write_text('[motion]\nfile = "a/b.txt"\nfps = 30\n[[file]]\nmotion = "c.NPZ"\n')
    assert collection.files_named_in(library) == {"a/b.txt", "c.NPZ"}


@pytest.mark.parametrize(
    ("core", "message"),
    [
        ('file = "d/tpyo.bvh"', r"core.toml names the motion file 'd/tpyo.bvh', which is not in"),
        ('file = "../a.bvh"', r"core.toml: '../a.bvh' is not a path inside"),
        ("file = ", r"core.toml is not valid TOML"),
    ],
)
def test_wrong_libraries_are_refused(core: str, message: str, tmp_path: Path) -> None:
    sources = _load(tmp_path, CLIP)
    with pytest.raises(SpecError, match=message):
        collection.collection_files("core", sources, **_libraries(tmp_path, core))


def test_missing_library_and_unknown_collection(tmp_path: Path) -> None:
    sources = _load(tmp_path, CLIP)
    with pytest.raises(SpecError, match=r"core.toml: no such file.*install dynresp again"):
        collection.collection_files("core", sources, reactions=tmp_path, examples=tmp_path)
    with pytest.raises(UnknownNameError, match=r"unknown collection 'cor'.*'core'"):
        collection.collection_files("cor", sources)


@pytest.mark.mocap
@pytest.mark.skipif(not os.environ.get("DYNRESP_MOTIONS"), reason="DYNRESP_MOTIONS is not set")
def test_shipped_facts_are_those_of_the_files() -> None:
    folders = [Path(part) for part in os.environ["DYNRESP_MOTIONS"].split(os.pathsep)]
    sources = catalogue.load_sources()
    found = {file: find_motion_file(file, folders) for file in sources}
    present = {file: path for file, path in found.items() if path is not None}
    if not present:
        pytest.skip("DYNRESP_MOTIONS holds none of the files in sources.csv")
    for file, path in present.items():
        content = path.read_bytes()
        assert len(content) == sources[file].size, file
        assert hashlib.sha256(content).hexdigest() == sources[file].sha256, file
    clips = {file for file in present if sources[file].kind == "clip"}
    listed = {str(path.relative_to(d).as_posix()) for d in folders for path in list_motion_files(d)}
    assert clips <= listed
