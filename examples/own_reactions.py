"""A reaction library of your own: a TOML file that names the reactions.

This one knows two falls and nothing else, so even a light ball ends on the ground. Entries may also
name frames of your own motion files; reactions/README.md says how.
"""

import sys
from pathlib import Path

import dynresp

OUT = Path(sys.argv[1] if len(sys.argv) > 1 else "example-out")
OUT.mkdir(parents=True, exist_ok=True)

LIBRARY = """
[[reaction]]
name = "fall to the side"
strategy = "side_fall"
builtin = "side_fall"

[[reaction]]
name = "roll backward"
strategy = "backward_roll"
builtin = "backward_roll"
"""
file = OUT / "falls.toml"
file.write_text(LIBRARY)
library = dynresp.load_library(file)
print([reaction.name for reaction in library.reactions])

ball = dynresp.Ball(time=1.5, mass=4, speed=9, from_deg=0)
# No classifier was trained for this library, so the full search chooses.
response = dynresp.hit("builtin:idle", ball, library=library, budget="best")
print(f"{response.outcome}: {response.reaction}")
response.save(OUT, write=["filmstrip.png"])
(OUT / "filmstrip.png").replace(OUT / "own_reactions.png")
