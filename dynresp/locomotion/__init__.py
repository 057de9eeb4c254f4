"""Graph-based locomotion: endless, plausible motion out of recorded frames, and its control.

The rooms, in the order in which they build on each other:

- `graph`: the lower layer. Recorded frames, the ways between them, and walks through them.
- `playing`: walks as motion. Jumps blended, brought to a frame rate, the feet fitted.
- `clusters`: the higher layer. Groups of frames, and what can be reached from each.
- `choice`: a few actions offered at any moment.
- `worlds`: obstacles, mazes, blocks of rough terrain, a step stool, a playground.
- `sketch`: walks along a path drawn on the ground.
- `vision`: actions taken from the silhouettes of a person in a video.
- `avatar`: avatars that are hit on their way, answer, and walk on.

`warping`, dynamic time warping, serves both sketch and vision. The sources are Lee, Chai, Reitsma,
Hodgins & Pollard 2002 (all rooms) and, for the responder behind `avatar`, the package `response`.
"""
