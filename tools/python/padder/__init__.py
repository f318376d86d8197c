# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangle meshes to clusters of spheres, and the contacts between spheres.

    import padder
    cluster = padder.pad(vertices, faces, tolerance="1%")
    contacts = padder.detect(cluster.centers, cluster.radii)

Every function's shapes and units are in the stubs (__init__.pyi) and in docs/python.md.
"""
from ._core import Bodies, Cluster, Contacts, Detector, DeviceArray, Error, __version__, detect, load, pad, pad_file

__all__ = ["Bodies", "Cluster", "Contacts", "Detector", "DeviceArray", "Error", "detect", "load", "pad", "pad_file"]
