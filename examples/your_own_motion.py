"""Your own BVH file in, the response as BVH out.

Give the path of a BVH, AMC or DeepMimic file as the second argument. Without one, this script
writes a built-in motion as BVH first and takes that file.
"""

import sys
from pathlib import Path

import dynresp

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")

if len(sys.argv) > 2:
    file = Path(sys.argv[2])
else:
    # A push that nobody feels: what is saved is the walk itself.
    nothing = dynresp.hit("builtin:walk", dynresp.Push(time=1.5, force=1), library="builtin")
    nothing.save(OUT / "recording", write=["motion.bvh"])
    file = OUT / "recording" / "motion.bvh"

motion = dynresp.load_motion(file)
print(f"{file.name}: {len(motion)} frames, {motion.duration:.1f} s")
push = dynresp.Push(time=motion.duration / 3, force=1500, duration=0.2, from_deg=90)
response = dynresp.hit(motion, push, library="builtin")
response.save(OUT, write=["motion.bvh", "filmstrip.png"])
print(f"{response.outcome}; the answer is {OUT / 'motion.bvh'}")
(OUT / "filmstrip.png").replace(OUT / "your_own_motion.png")
