"""Avatars on a motion graph: they walk without end, are hit, and walk on.

A motion graph joins frames that look alike, so a walk never ends. The picture shows three paths
from above, each from its own start; the dots mark where a push begins.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dynresp

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
OUT.mkdir(parents=True, exist_ok=True)
FPS, SECONDS, AVATARS = 30, 20, 3

graph = dynresp.build_graph("builtin")
library = dynresp.load_library("builtin")
avatars = dynresp.AvatarCrowd.wandering(graph, library, count=AVATARS, seed=2)

rng = np.random.default_rng(2)
shown, hits = [], []
for frame in range(FPS * SECONDS):
    if frame % (6 * FPS) == 2 * FPS:
        for k, avatar in enumerate(avatars.avatars):
            push = dynresp.Push(time=0.2, force=900, duration=0.2, from_deg=rng.uniform(0, 360))
            avatar.hit(push)
            hits.append((frame + round(0.2 * FPS), k))
    shown.append(avatars.advance())  # (avatars, 59) poses
paths = np.array(shown)[:, :, :2]
paths -= paths[0]

figure, axes = plt.subplots(figsize=(8, 7), layout="constrained")
for k in range(AVATARS):
    axes.plot(paths[:, k, 0], paths[:, k, 1], label=f"avatar {k + 1}")
for frame, k in hits:
    axes.plot(paths[frame, k, 0], paths[frame, k, 1], "o", color=f"C{k}")
axes.set_title(f"{SECONDS} s of walking, three pushes each")
axes.set_xlabel("x [m]")
axes.set_ylabel("y [m]")
axes.set_aspect("equal")
axes.legend()
figure.savefig(OUT / "avatars_walk_on.png", dpi=100)
