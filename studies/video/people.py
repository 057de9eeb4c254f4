"""People with other shapes than the character's, and the recordings that they perform."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from dynresp.motion.character import Character
from dynresp.motion.load import LoadOptions, load_motion
from dynresp.motion.motion import Motion
from dynresp.support.paths import models_folder

# Longest and shortest pieces into which videos are cut [s].
_PIECE_S, _LEAST_S = 20.0, 1.5


@dataclass(frozen=True)
class Body:
    """How a person differs from the character.

    Attributes:
        height: Of the standing person [m]; the character's is 1.74.
        legs: Factor of the length of the legs beside that of the whole.
        arms: The same for the arms.
        girth: Factor of the width of trunk and limbs, clothes included.
    """

    height: float = 1.74
    legs: float = 1.0
    arms: float = 1.0
    girth: float = 1.0

    def character(self, folder: Path) -> Character:
        """A character of this shape; its model file is written into a folder."""
        spec = mujoco.MjSpec.from_file(str(models_folder() / "ragdoll.xml"))
        whole = self.height / 1.74
        for part in spec.bodies:
            if part.parent is None or part.parent.name == "world":
                part.pos = np.asarray(part.pos) * whole * self.legs
            else:
                # Where a limb begins is its parent's matter.
                part.pos = np.asarray(part.pos) * whole * self._stretch(part.parent.name, False)
            length = whole * self._stretch(part.name, True)
            for geom in part.geoms:
                girth = whole * (1.0 if geom.name in ("head", "neck") else self.girth)
                if geom.type == mujoco.mjtGeom.mjGEOM_BOX:
                    geom.pos = np.asarray(geom.pos) * length
                    geom.size = np.asarray(geom.size) * [length, whole, length]
                else:
                    geom.fromto = np.asarray(geom.fromto) * length
                    geom.size = [geom.size[0] * girth, 0.0, 0.0]
        folder.mkdir(parents=True, exist_ok=True)
        shape = "-".join(f"{x:g}" for x in dataclasses.astuple(self))
        file = folder / f"person-{shape}.xml"
        spec.compile()
        file.write_text(spec.to_xml())
        return Character(file)

    def _stretch(self, name: str, ends: bool) -> float:
        """Factor of a part's length; of those that only end a limb, too."""
        kind = name.removeprefix("left_").removeprefix("right_")
        if kind in ("thigh", "shank") or (ends and kind == "foot"):
            return self.legs
        if kind == "upper_arm" or (ends and kind == "forearm"):
            return self.arms
        return 1.0


@dataclass(frozen=True)
class Person:
    """A performer with motion capture.

    Attributes:
        name: For people.
        body: The shape in which the person is filmed, not the shape of who was captured.
        motions: Names of motion files in a motions folder, with wildcards.
        studio: Who captured the motion. People of one studio are left out together: somebody may
            be there under two names, and skeletons and manners are alike.
        known: Whether settings of control by video were chosen with a view to this person's videos.
    """

    name: str
    body: Body
    motions: tuple[str, ...]
    studio: str
    known: bool = True

    def files(self, folders: Sequence[Path]) -> list[Path]:
        """The motion files that there are, in the order of the names."""
        found = {
            file.relative_to(folder).as_posix(): file
            for pattern in self.motions
            for folder in folders
            for file in sorted(folder.glob(pattern))
        }
        return list(found.values())


_SNU = "snumrl_ys2010"
_CMU, _PAIR = "CMU", "SNU, hys and mmk"
PEOPLE = (
    Person(
        "wd2",
        Body(1.69, 1.04, 0.97, 1.30),
        (
            f"{_SNU}/VideoMotion/wd2_cross_walk_*.bvh",
            f"{_SNU}/VideoMotion/wd2_freeWalk_01.bvh",
            f"{_SNU}/VideoMotion/wd2_st*.bvh",
            f"{_SNU}/Physics2/wd2_WalkBackward*.bvh",
            f"{_SNU}/Physics2/wd2_WalkForward*0[01].bvh",
            f"{_SNU}/Physics2/wd2_Physics_Jump*.bvh",
            f"{_SNU}/Physics2/wd2_Physics_2_Push03.bvh",
            f"{_SNU}/Physics2/wd2_Physics_Raise0[01].bvh",
            f"{_SNU}/Physics2/wd2_PushBackStep00.bvh",
            f"{_SNU}/Balancing/*.bvh",
            f"{_SNU}/motion_edit/*.bvh",
            "snumrl_TillingPatch/3/walk*.amc",
            "snumrl_TillingPatch/3/jump.amc",
            "snumrl_TillingPatch/3/pass_duck.amc",
            "snumrl_TillingPatch/3/get_hit.amc",
            "snumrl_TillingPatch/3/beat.amc",
            "snumrl_TillingPatch/3/push*.amc",
            "snumrl_TillingPatch/1/*run*.amc",
            "snumrl_TillingPatch/1/punch.amc",
            "snumrl_TillingPatch/1/slap.amc",
            "snumrl_TillingPatch/1/flying_kick.amc",
            "snumrl_TillingPatch/1/avoid.amc",
            "snumrl_TillingPatch/1/get_hit.amc",
            "snumrl_TillingPatch/2/*duck*.amc",
            f"{_SNU}/samsung_boxing/boxman/*stand*.bvh",
        ),
        "SNU, wd2",
        known=False,
    ),
    Person("02", Body(1.83, 1.05, 1.00, 1.20), ("cmu/02/*.amc",), _CMU),
    Person("09", Body(1.60, 0.94, 1.03, 1.05), ("cmu/09/*.amc",), _CMU),
    Person("16", Body(1.92, 1.03, 0.97, 1.30), ("cmu/16/*.amc",), _CMU),
    Person("17", Body(1.52, 0.97, 0.95, 1.15), ("cmu/17/*.amc",), _CMU),
    Person("127", Body(1.70, 1.06, 1.05, 1.40), ("cmu/127/*.amc",), _CMU),
    Person("hys", Body(1.78, 0.95, 1.02, 1.25), ("snumrl_TillingPatch/multi/hys_*.amc",), _PAIR),
    Person("mmk", Body(1.66, 1.02, 0.96, 1.35), ("snumrl_TillingPatch/multi/mmk_*.amc",), _PAIR),
    # Several people, recorded at the same place as the subjects.
    Person("deepmimic", Body(1.87, 0.98, 1.04, 1.10), ("deepmimic/humanoid3d_*.txt",), _CMU),
    Person("14", Body(1.63, 0.98, 1.05, 1.25), ("cmu/14/*.amc",), _CMU, known=False),
    # Several people as well.
    Person(
        "stunts",
        Body(1.80, 1.02, 1.03, 1.15),
        ("snumrl_TimeCriticalResponse/*.bvh",),
        "SNU, stunts",
        known=False,
    ),
)
"""The people of the motion collections that dynresp knows.

Where a ground is uneven, or somebody climbs, the places of limbs say little: subjects 01 and 03
are not among them.
"""


def pieces(files: Sequence[Path], most_s: float) -> list[tuple[Path, float, float]]:
    """Pieces of motions to film, spread over all of them.

    Args:
        files: The motions.
        most_s: About how long they may last together [s].

    Returns:
        File, and where each piece begins and ends as shares of its duration.
    """
    cut: list[tuple[Path, float, float, float]] = []
    for file in files:
        duration = load_motion(file, options=OPTIONS).duration
        count = max(1, round(duration / _PIECE_S))
        if duration / count >= _LEAST_S:
            cut += [(file, k / count, (k + 1) / count, duration / count) for k in range(count)]
    total = sum(piece[3] for piece in cut)
    chosen = cut if total <= most_s else cut[:: -int(-total // most_s)]
    return [piece[:3] for piece in chosen]


def cut_out(motion: Motion, begin: float, end: float) -> Motion:
    """A piece of a motion, from and to shares of its frames."""
    return motion.slice(round(begin * len(motion)), round(end * len(motion)))


OPTIONS = LoadOptions(trim_t_poses=True)
"""How their motions are read."""
