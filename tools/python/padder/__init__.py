# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangle meshes to clusters of spheres, and the contacts between spheres.

    import padder
    cluster = padder.pad(vertices, faces, tolerance="1%")
    contacts = padder.detect(cluster.centers, cluster.radii)

Every function's shapes and units are in the stubs (__init__.pyi) and in docs/python.md.
"""
import atexit

from ._core import (
    EVERY_WORLD, NO_CONTACT, Bodies, Cluster, Contacts, Detector, DeviceArray, Error, Robot, WorldAnswers, __version__,
    _finish, detect, load, pad, pad_file, pad_urdf, worlds,
)

__all__ = [
    "EVERY_WORLD", "NO_CONTACT", "Bodies", "Cluster", "Contacts", "Detector", "DeviceArray", "Error", "Robot", "WorldAnswers",
    "detect", "load", "pad", "pad_file", "pad_urdf", "worlds",
]

# What was given up by Ctrl-C ends before the module's memory goes.
atexit.register(_finish)
