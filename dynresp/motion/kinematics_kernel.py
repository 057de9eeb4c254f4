"""The compiled kinematics of the character: where all bodies are, frame by frame.

Importing this module imports numba; so import it where it is used. The sums are those of
`rotations.multiply` and `rotations.rotate`, in their order.
"""

from __future__ import annotations

from numba import types

from dynresp.support.compiling import compiled, helper

_ROWS = types.Array(types.float64, 2, "C", readonly=True)
_INTS = types.Array(types.int64, 1, "C", readonly=True)
_OUT = types.float64[:, :, ::1]
_SIGNATURE = types.void(_ROWS, _INTS, _ROWS, _ROWS, _OUT, _OUT, _OUT)


@helper(inline="always")
def _carry(q, v, start, out):
    """A point v of a frame that is turned by q and begins at start."""
    p = 2.0 * (q[2] * v[2] - q[3] * v[1])
    s = 2.0 * (q[3] * v[0] - q[1] * v[2])
    r = 2.0 * (q[1] * v[1] - q[2] * v[0])
    out[0] = start[0] + (v[0] + q[0] * p + q[2] * r - q[3] * s)
    out[1] = start[1] + (v[1] + q[0] * s + q[3] * p - q[1] * r)
    out[2] = start[2] + (v[2] + q[0] * r + q[1] * s - q[2] * p)


@compiled(_SIGNATURE)
def kinematics_kernel(poses, parents, offsets, center_offsets, positions, quaternions, centers):
    """Write where the bodies are.

    Args:
        poses: (frames, 59).
        parents: (bodies,) -1 for the pelvis; parents before children.
        offsets: (bodies, 3) origin of each in its parent's frame [m].
        center_offsets: (bodies, 3) centre of mass of each in its own frame [m].
        positions: Out, (frames, bodies, 3).
        quaternions: Out, (frames, bodies, 4).
        centers: Out, (frames, bodies, 3).
    """
    for frame in range(len(poses)):
        pose = poses[frame]
        for body in range(len(parents)):
            parent = parents[body]
            b = pose[3 + 4 * body : 7 + 4 * body]
            own, place = quaternions[frame, body], positions[frame, body]
            if parent < 0:
                for axis in range(4):
                    own[axis] = b[axis]
                for axis in range(3):
                    place[axis] = pose[axis]
            else:
                a = quaternions[frame, parent]
                own[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
                own[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
                own[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
                own[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
                _carry(a, offsets[body], positions[frame, parent], place)
            _carry(own, center_offsets[body], place, centers[frame, body])
