# SPDX-License-Identifier: GPL-3.0-or-later
"""Pads a mesh given as arrays, puts the cluster at 27 places, and finds the contacts between the copies."""
import numpy as np

import padder

# A tetrahedron with edges of about 1.4: points and triangles, seen from outside against the clock.
vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])

cluster = padder.pad(vertices, faces, tolerance="3%", unit="m")
print(f"{len(cluster.radii)} spheres, certified: {cluster.accuracy['certified']}, "
      f"gap at most {cluster.accuracy['gap_bound']:.3f} m")

# Three by three by three copies, 0.9 m apart. A pose is the rotation row by row, then the position.
places = 0.9 * np.stack(np.meshgrid(*[np.arange(3)] * 3), axis=-1).reshape(-1, 3)
poses = np.hstack([np.tile(np.eye(3).ravel(), (len(places), 1)), places])
bodies = padder.Bodies([cluster], poses, np.zeros(len(places), dtype=np.uint32))

contacts = padder.detect(bodies=bodies)  # spheres of one body are no contact
print(f"{len(contacts.pairs)} contacts, the deepest {contacts.depth.max():.4f} m")

# Spheres are numbered body by body: the quotient is the body.
touching = np.unique(contacts.pairs // len(cluster.radii), axis=0)
print(f"{len(touching)} pairs of copies touch")
assert cluster.accuracy["certified"] and len(touching) > 0
assert np.all(touching[:, 0] != touching[:, 1])
