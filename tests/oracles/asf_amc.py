"""ASF/AMC read slowly and plainly: one bone, one frame, one 3 x 3 matrix at a time.

Made to be read beside the format's description, not to be robust: it expects a sound file.
"""

import math
from pathlib import Path

import numpy as np


def turn(axis: str, degrees: float) -> np.ndarray:
    """Matrix of a turn about x, y or z."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array(
        {
            "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
            "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
        }[axis]
    )


def turns_in_order(order: str, angles: dict[str, float]) -> np.ndarray:
    """First about the first letter of `order`, then about the next, all about fixed axes."""
    matrix = np.eye(3)
    for axis in order:
        matrix = turn(axis, angles.get(axis, 0.0)) @ matrix
    return matrix


def read_asf(path: Path) -> tuple[dict[str, dict], dict[str, list[str]]]:
    """Bones by name (direction, length, axis, order, dof) and children by name."""
    bones: dict[str, dict] = {}
    children: dict[str, list[str]] = {}
    section, bone = "", {}
    for line in path.read_text().splitlines():
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if words[0].startswith(":"):
            section = words[0]
        elif section == ":root" and words[0] == "order":
            dof = [word.lower() for word in words[1:]]
            bones["root"] = {"dof": dof, "axis": [0, 0, 0], "vector": np.zeros(3), "order": "xyz"}
        elif section == ":bonedata":
            if words[0] == "begin":
                bone = {"dof": []}
            elif words[0] == "name":
                bone["name"] = words[1]
            elif words[0] == "direction":
                bone["direction"] = np.array([float(word) for word in words[1:4]])
            elif words[0] == "length":
                bone["length"] = float(words[1])
            elif words[0] == "axis":
                bone["axis"] = [float(word) for word in words[1:4]]
                bone["order"] = words[4].lower()
            elif words[0] == "dof":
                bone["dof"] = words[1:]
            elif words[0] == "end":
                norm = np.linalg.norm(bone["direction"])
                bone["vector"] = bone["direction"] / (norm or 1.0) * bone["length"]
                bones[bone["name"]] = bone
        elif section == ":hierarchy" and words[0] not in ("begin", "end"):
            children[words[0]] = words[1:]
    return bones, children


def read_amc(path: Path) -> list[dict[str, list[float]]]:
    """One frame after the other: bone name to numbers."""
    frames: list[dict[str, list[float]]] = []
    for line in path.read_text().splitlines():
        words = line.split()
        if not words or words[0][0] in "#:":
            continue
        if len(words) == 1:
            frames.append({})
        else:
            frames[-1][words[0]] = [float(word) for word in words[1:]]
    return frames


def bone_starts(asf: Path, amc: Path) -> list[dict[str, np.ndarray]]:
    """Where each bone starts, and ends if it is the last of its chain, in the file's unit and axes.

    Keys are the bones' names, and those of the free ends with "_end" added.
    """
    bones, children = read_asf(asf)
    result = []
    for frame in read_amc(amc):
        numbers = dict(zip(bones["root"]["dof"], frame["root"], strict=True))
        at = np.array([numbers["tx"], numbers["ty"], numbers["tz"]])
        places: dict[str, np.ndarray] = {}
        _place("root", at, np.eye(3), bones, children, frame, places)
        result.append(places)
    return result


def _place(name, start, above, bones, children, frame, places):
    """Put a bone at `start`, turned on top of its parent's rotation `above`, then its children."""
    bone = bones[name]
    places[name] = start
    angles = {
        channel[1]: value
        for channel, value in zip(bone["dof"], frame.get(name, []), strict=True)
        if channel[0] == "r"
    }
    frame_of_bone = turns_in_order(bone["order"], dict(zip("xyz", bone["axis"], strict=True)))
    rotation = above @ frame_of_bone @ turns_in_order(bone["order"], angles) @ frame_of_bone.T
    end = start + rotation @ bone["vector"]
    for child in children.get(name, []):
        _place(child, end, rotation, bones, children, frame, places)
    if not children.get(name):
        places[f"{name}_end"] = end
