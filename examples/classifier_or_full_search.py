"""Does the classifier choose as well as the full search?

The classifier guesses the reaction from how a hit begins; the full search compares all reactions.
Both are judged by the mismatch (window error) of what they chose: on the diagonal they are equal.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import dynresp

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
OUT.mkdir(parents=True, exist_ok=True)

rng = np.random.default_rng(5)
fast, best = [], []
for _ in range(40):
    ball = dynresp.Ball(
        time=rng.uniform(1.0, 6.0),
        mass=rng.uniform(3.0, 8.0),
        speed=rng.uniform(4.0, 14.0),
        from_deg=rng.uniform(0.0, 360.0),
    )
    guessed = dynresp.hit("builtin:walk", ball, library="builtin", budget="fast")
    searched = dynresp.hit("builtin:walk", ball, library="builtin", budget="best")
    if guessed.response.error is not None and searched.response.error is not None:
        fast.append(guessed.response.error)
        best.append(searched.response.error)

same = int(np.isclose(fast, best, rtol=0.01).sum())
print(f"{same} of {len(best)} choices are as good to 1 %")
figure, axes = plt.subplots(figsize=(6, 6), layout="constrained")
most = 1.05 * max(fast)
axes.plot([0, most], [0, most], color="0.8")
axes.scatter(best, fast)
axes.set_title("Mismatch of the choice, sum over 14 bodies [m]")
axes.set_xlabel("full search")
axes.set_ylabel("classifier")
axes.set_aspect("equal")
figure.savefig(OUT / "classifier_or_full_search.png", dpi=100)
