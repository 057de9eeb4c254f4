"""Small motion files of every format, made by the tests themselves."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

BVH_PERSON = """HIERARCHY
ROOT Hips
{
  OFFSET 0 95 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT LeftUpLeg
  {
    OFFSET 9 -8 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT LeftLeg
    {
      OFFSET 0 -43 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      JOINT LeftFoot
      {
        OFFSET 0 -42 0
        CHANNELS 3 Zrotation Xrotation Yrotation
        End Site
        {
          OFFSET 0 -4 16
        }
      }
    }
  }
  JOINT RightUpLeg
  {
    OFFSET -9 -8 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT RightLeg
    {
      OFFSET 0 -43 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      JOINT RightFoot
      {
        OFFSET 0 -42 0
        CHANNELS 3 Zrotation Xrotation Yrotation
        End Site
        {
          OFFSET 0 -4 16
        }
      }
    }
  }
  JOINT Spine
  {
    OFFSET 0 12 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT Head
    {
      OFFSET 0 40 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 0 18 0
      }
    }
    JOINT LeftArm
    {
      OFFSET 18 35 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 55 0 0
      }
    }
    JOINT RightArm
    {
      OFFSET -18 35 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET -55 0 0
      }
    }
  }
}
MOTION
"""
BVH_PERSON_COLUMNS = 36

ASF_PERSON = """# made for tests
:version 1.10
:name TEST
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
  a small person
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name lhip
    direction 1 0 0
    length 1.6
    axis 0 0 0 XYZ
  end
  begin
    id 2
    name lfemur
    direction 0.34202 -0.939693 0
    length 7.6
    axis 0 0 20 XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
    id 3
    name ltibia
    direction 0.34202 -0.939693 0
    length 7.4
    axis 0 0 20 XYZ
    dof rx
    limits (-10.0 170.0)
  end
  begin
    id 4
    name lfoot
    direction 0 -0.3 0.953939
    length 3.2
    axis -90 0 20 ZXY
    dof rx rz
  end
  begin
    id 5
    name spine
    direction 0 1 0
    length 8
    axis 10 20 30 YZX
    dof rz rx ry
  end
  begin
    id 6
    name head
    direction 0 1 0
    length 4
    axis 0 0 0 XYZ
    dof rx ry rz
  end
:hierarchy
  begin
    root lhip spine
    lhip lfemur
    lfemur ltibia
    ltibia lfoot
    spine head
  end
"""
AMC_DOFS = {"root": 6, "spine": 3, "head": 3, "lfemur": 3, "ltibia": 1, "lfoot": 2}


def bvh_person(frames: int = 4, seed: int = 0, frame_time: str = "0.0333333") -> str:
    """A person who stands in centimetres, Y up, and moves a little."""
    rng = np.random.default_rng(seed)
    values = rng.normal(0.0, 8.0, (frames, BVH_PERSON_COLUMNS))
    values[:, :3] = rng.normal([0.0, 95.0, 0.0], 3.0, (frames, 3))
    rows = "\n".join(" ".join(f"{value:.6g}" for value in row) for row in values)
    return f"{BVH_PERSON}Frames:\t{frames}\nFrame Time:\t{frame_time}\n{rows}\n"


def amc_person(frames: int = 4, seed: int = 0, header: str = "") -> str:
    """A motion of ASF_PERSON, in 1/0.45 inch."""
    rng = np.random.default_rng(seed)
    lines = ["#!made for tests", ":FULLY-SPECIFIED", ":DEGREES"]
    lines += [header] if header else []
    for frame in range(1, frames + 1):
        lines.append(str(frame))
        for bone, count in AMC_DOFS.items():
            values = rng.normal(0.0, 20.0, count)
            if bone == "root":
                values[:3] = [1.0, 17.0, 2.0]
            lines.append(" ".join([bone, *(f"{value:.6g}" for value in values)]))
    return "\n".join(lines) + "\n"


def deepmimic_rows(frames: int = 4, seed: int = 0, step: float = 0.0333333) -> list[list[float]]:
    """Rows of a DeepMimic motion: a person who stands and moves a little."""
    rng = np.random.default_rng(seed)
    rows = []
    for frame in range(frames):
        row = [step if frame < frames - 1 else 0.0, 0.1 * frame, 0.85, 0.0]
        for width in (4, 4, 4, 4, 1, 4, 4, 1, 4, 1, 4, 4, 1):
            if width == 1:
                row.append(float(rng.normal(0.0, 0.3)))
            else:
                q = np.array([1.0, 0.0, 0.0, 0.0]) + rng.normal(0.0, 0.1, 4)
                row += list(map(float, q / np.linalg.norm(q)))
        rows.append(row)
    return rows


def deepmimic_person(frames: int = 4, seed: int = 0) -> str:
    """A DeepMimic motion file."""
    return json.dumps({"Loop": "none", "Frames": deepmimic_rows(frames, seed)}, indent=0)


@dataclass(frozen=True)
class AmcPair:
    """An AMC file and its skeleton on disk."""

    amc: Path
    asf: Path


def write_amc_person(folder: Path, **kwargs: int | str) -> AmcPair:
    """Write ASF_PERSON and a motion of it into a folder."""
    pair = AmcPair(folder / "person_walk.amc", folder / "person.asf")
    pair.amc.write_text(amc_person(**kwargs))  # type: ignore[arg-type]
    pair.asf.write_text(ASF_PERSON)
    return pair
