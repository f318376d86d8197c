# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangle meshes to clusters of spheres, and the contacts between spheres.

    import padder
    cluster = padder.pad(vertices, faces, tolerance="1%")
    contacts = padder.detect(cluster.centers, cluster.radii)

Every function's shapes and units are in the stubs (__init__.pyi) and in docs/python.md.
"""
from ._core import (
    EVERY_WORLD, NO_CONTACT, Bodies, Cluster, Contacts, Detector, DeviceArray, Error, WorldAnswers, __version__, detect, load, pad,
    pad_file, worlds,
)

__all__ = [
    "EVERY_WORLD", "NO_CONTACT", "Bodies", "Cluster", "Contacts", "Detector", "DeviceArray", "Error", "WorldAnswers", "detect", "load",
    "pad", "pad_file", "worlds",
]
