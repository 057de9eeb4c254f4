"""The same ball from 32 directions: which reaction answers it, and how far the person is moved.

Everything starts at the same moment of the same walk, so only the direction differs. In the picture
the person looks up; a dot stands where the ball comes from, as far out as the pelvis moves.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dynresp

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
OUT.mkdir(parents=True, exist_ok=True)

moved: dict[str, list[tuple[float, float]]] = {}
for from_deg in np.arange(0.0, 360.0, 11.25):
    ball = dynresp.Ball(time=1.5, mass=5, speed=9, from_deg=from_deg)
    response = dynresp.hit("builtin:walk", ball, library="builtin")
    name = (response.reaction or "no reaction").removesuffix("_mirrored").replace("_", " ")
    start = response.response.contact_frame or 0
    after = min(start + 45, len(response.poses) - 1)  # 1.5 s
    way = np.linalg.norm(response.poses[after, :2] - response.poses[start, :2])
    moved.setdefault(name, []).append((np.deg2rad(from_deg), float(way)))
    print(f"from {from_deg:6.2f} degrees: {name}, {way:.2f} m")

figure, axes = plt.subplots(
    figsize=(8, 7), layout="constrained", subplot_kw={"projection": "polar"}
)
axes.set_theta_zero_location("N")
for name, dots in sorted(moved.items()):
    angles, distances = zip(*dots, strict=True)
    axes.plot(angles, distances, "o", markersize=9, label=name)
axes.set_title("How far the pelvis moves in 1.5 s [m] after a ball of 5 kg at 9 m/s")
axes.legend(loc="upper left", bbox_to_anchor=(-0.3, 1.0))
figure.savefig(OUT / "from_all_sides.png", dpi=100)
