"""Sixty random balls from an experiment file, and which reactions answer them.

An experiment file can draw its values at random. The seed makes the same hits again.
"""

import sys
from collections import Counter
from pathlib import Path

import matplotlib.pyplot as plt

import dynresp

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
OUT.mkdir(parents=True, exist_ok=True)

SPEC = """
[experiment]
name = "Balls from everywhere"
seed = 7
count = 60
show = 0

[base]
motion = "builtin:walk"

[[impact]]
kind = "ball"
time_s = { uniform = [1.0, 6.0] }
mass_kg = { uniform = [3.0, 8.0] }
speed_m_s = { uniform = [4.0, 14.0] }
from_deg = { uniform = [0.0, 360.0] }
height_m = { uniform = [0.3, 1.7] }

[library]
which = "builtin"
"""
spec = OUT / "many_hits.toml"
spec.write_text(SPEC)
result = dynresp.run(spec)
result.save(OUT / "many_hits")  # summary.json and table.csv

counts = Counter(
    (r.reaction or r.outcome).removesuffix("_mirrored").replace("_", " ") for r in result
)
names = [name for name, _ in reversed(counts.most_common())]
figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
axes.barh(names, [counts[name] for name in names])
axes.set_title(f"How {len(result)} random balls at a walking person are answered")
axes.set_xlabel("hits")
axes.xaxis.get_major_locator().set_params(integer=True)
figure.savefig(OUT / "many_hits.png", dpi=100)
print(*(f"{counts[name]:3d}  {name}" for name in reversed(names)), sep="\n")
