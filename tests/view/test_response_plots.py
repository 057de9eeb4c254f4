from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from dynresp.support.errors import MotionError
from dynresp.view.response_plots import RankedReaction, write_alignment

EXITS, ENTRIES = np.arange(6) / 30, np.arange(20) / 30
RANKING = [RankedReaction("step", 1.0), RankedReaction("roll", 3.0), RankedReaction("no", np.inf)]


def bowl() -> np.ndarray:
    return (EXITS[:, None] - 0.1) ** 2 + (ENTRIES - 0.3) ** 2


def test_map_surface_and_ranking(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    errors = bowl()
    errors[0, :3], errors[-1, -1] = np.nan, np.inf
    write_alignment(
        tmp_path / "a.png", errors, EXITS, ENTRIES, 0.1, 0.3, "a title", unit="m²",
        ranking=RANKING, chosen_name="step",
    )  # fmt: skip
    picture = matplotlib.image.imread(tmp_path / "a.png")
    assert picture.shape[:2] == (660, 1980)
    red = (picture[..., 0] > 0.8) & (picture[..., 1] < 0.3) & (picture[..., 2] < 0.3)
    assert red.sum() > 100
    assert capfd.readouterr().out == ""
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("shape", [(1, 20), (6, 1), (1, 1), (6, 20)])
def test_flat_and_thin_surfaces(tmp_path: Path, shape: tuple[int, int]) -> None:
    exits, entries = EXITS[: shape[0]], ENTRIES[: shape[1]]
    write_alignment(tmp_path / "a.png", np.ones(shape), exits, entries, exits[0], entries[-1])
    assert (tmp_path / "a.png").stat().st_size > 5000


def test_surfaces_that_cannot_be_shown(tmp_path: Path) -> None:
    file = tmp_path / "a.png"
    with pytest.raises(MotionError, match=r"\(6, 20\), exits by entries"):
        write_alignment(file, bowl().T, EXITS, ENTRIES, 0.1, 0.3)
    with pytest.raises(MotionError, match="no finite"):
        write_alignment(file, np.full((6, 20), np.nan), EXITS, ENTRIES, 0.1, 0.3)
    with pytest.raises(MotionError, match="rise"):
        write_alignment(file, bowl(), EXITS[::-1], ENTRIES, 0.1, 0.3)
    assert not list(tmp_path.iterdir())


def test_a_ranking_of_many_and_of_none(tmp_path: Path) -> None:
    many = [RankedReaction(f"reaction {k}", k + 1.0) for k in range(60)]
    place = (bowl(), EXITS, ENTRIES, 0.1, 0.3)
    write_alignment(tmp_path / "a.png", *place, ranking=many, chosen_name="reaction 50")
    none = [RankedReaction("no", np.inf)]
    with pytest.raises(MotionError, match="no reaction"):
        write_alignment(tmp_path / "b.png", *place, ranking=none, chosen_name="no")
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.parametrize("text", ["price $\\foo{$ up", "one $ and $ two"])
def test_dollar_signs_are_no_mathematics(
    tmp_path: Path, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.figure import Figure

    drawn: list[Figure] = []
    save = Figure.savefig

    def savefig(self: Figure, *args: object, **options: object) -> None:
        drawn.append(self)
        save(self, *args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(Figure, "savefig", savefig)
    ranking = [RankedReaction(text, 1.0), RankedReaction("roll", 3.0)]
    write_alignment(
        tmp_path / "a.png", bowl(), EXITS, ENTRIES, 0.1, 0.3, text, unit=text, ranking=ranking,
        chosen_name=text,
    )  # fmt: skip
    for figure in drawn:
        assert not [t for t in figure.findobj(has_mathematics) if text in t.get_text()]


def has_mathematics(artist: object) -> bool:
    from matplotlib.text import Text

    return isinstance(artist, Text) and artist.get_parse_math()
