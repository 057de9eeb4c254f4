"""Results in plain words, from contents of `result.json` made here."""

from pathlib import Path
from typing import Any

import pytest

from dynresp.cli.result_text import choice_text, result_text


def content(choice: str = "step_back_mirrored", **base: Any) -> dict[str, Any]:
    """What `result.json` says of a hit after which a recorded reaction goes on."""
    return {
        "experiment": "A ball",
        "base": {"motion": "walk.bvh", **base},
        "library": {"name": "core"},
        "choosing": {"budget": "best"},
        "settings": {"window_s": 1.0 / 3.0},
        "motion": {"starts_in_base_at_s": 2.0},
        "quality": None,
        "files": {"motion.npz": "written", "video.mp4": "not written: no display"},
        "happened": {
            "outcome": "reaction",
            "contact": {"body": "left_thigh", "force_n": 812.4, "time_s": 1.5},
            "graze": False,
            "choice": choice,
            "error_m": 2.34,
            "alignment": {
                "exit_after_contact_s": 0.3,
                "exit_time_s": 1.8,
                "blend_end_time_s": 2.13,
                "entry_time_in_clip_s": 0.4,
                "entry_time_in_file_s": 5.4,
            },
        },
    }


def test_a_reaction_in_words() -> None:
    text = result_text(content(), Path("out"))
    for line in (
        "contact      left thigh, 812 N, at 1.50 s; 3.50 s of the base motion\n",
        "outcome      reaction: step back, mirrored\n",
        "chosen by    the full search (oracle): compares all reactions\n",
        "exit         out of the simulation 0.30 s after contact, at 1.80 s\n",
        "entry        into the reaction at 0.40 s of its clip (5.40 s of its file)\n",
        "blend        joins the two from 1.80 to 2.13 s\n",
        "mismatch     2.34 m: how far simulation and reaction are apart, summed over 14 bodies, "
        "averaged over 0.33 s\n",
        "written      out: result.json, motion.npz",
    ):
        assert line in text


@pytest.mark.parametrize(
    ("base", "clock"),
    [
        ({"start_s": 10.0}, "3.50 s of the base motion (13.50 s of its file)"),
        ({"start_s": 10.0, "trim_t_pose": True}, "3.50 s of the base motion\n"),
    ],
)
def test_a_cut_base_motion_has_two_clocks(base: dict[str, Any], clock: str) -> None:
    assert clock in result_text(content(**base), Path("out"))


def test_no_reaction_and_a_miss_in_words() -> None:
    made = content("carry_on", start_s=10.0)
    happened = made["happened"]
    happened["outcome"], happened["graze"] = "carry on", True
    del happened["alignment"]["entry_time_in_file_s"]
    text = result_text(made, Path("out"))
    assert "no reaction (carry on): the base motion goes on; the hit is too light" in text
    assert "back into the base motion, 0.40 s of the base motion (10.40 s of its file)" in text
    assert "how far simulation and base motion are apart" in text
    made["happened"] = {"outcome": "miss"}
    text = result_text(made, Path("out"))
    assert "miss: nothing was hit, and the base motion goes on" in text
    assert "chosen by" not in text


def test_what_is_unusual_about_the_choice() -> None:
    assert choice_text({"choosing": {"budget": "best"}}) is None
    about = {"choosing": {"instead_of": "fast"}, "library": {"name": "mine"}}
    assert "full search (oracle)" in str(choice_text(about))
    about = {"choosing": {"classifier": {"other_settings": ["window_s"]}}}
    assert "window_s" in str(choice_text(about))
