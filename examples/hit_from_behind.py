"""A heavy ball hits a walking person from behind.

The shortest way through dynresp: a base motion, an impact, and the response. The picture is the
filmstrip that every result folder holds.
"""

import sys
from pathlib import Path

import dynresp

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")

ball = dynresp.Ball(time=1.5, mass=6, speed=8, from_deg=180)
response = dynresp.hit("builtin:walk", ball, library="builtin")

print(f"{response.outcome}: {response.reaction}")
print(f"{len(response.poses)} poses at {response.fps:g} frames a second")
response.save(OUT, write=["motion.bvh", "recording.html", "filmstrip.png"])
print(f"open {OUT / 'recording.html'} in a browser")
(OUT / "filmstrip.png").replace(OUT / "hit_from_behind.png")
