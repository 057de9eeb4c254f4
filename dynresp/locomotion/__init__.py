"""Motion graphs: endless motion made of recorded frames, and the control of avatars on them.

The packages, in the order in which they build on each other:

- `graph`: recorded frames, the jumps between them, and paths through them (the lower layer).
- `playing`: paths played as motion, with blends at jumps, a frame rate and fitted feet.
- `clusters`: groups of frames, and which groups can be reached from a frame (the higher layer).
- `choice`: control by choice, among a few actions offered at any moment.
- `worlds`: obstacles, mazes, blocks of rough terrain, a step stool, a playground.
- `sketch`: control by a path drawn on the ground.
- `vision`: control by a person in a video, from silhouettes.
- `avatar`: avatars that are hit during a walk, react, and walk on.

The source is Lee, Chai, Reitsma, Hodgins & Pollard 2002. The responder of `avatar` is in the
package `response`.
"""
