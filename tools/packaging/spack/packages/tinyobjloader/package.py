# SPDX-License-Identifier: MIT
"""Spack's own recipe ends at 1.0.6, which knows no double precision."""
from spack.package import *


class Tinyobjloader(CMakePackage):
    """Reader of Wavefront OBJ in one header."""

    homepage = "https://github.com/tinyobjloader/tinyobjloader"
    git = "https://github.com/tinyobjloader/tinyobjloader.git"

    license("MIT")

    version("2.0.0rc10", commit="f48bd0bfb9b00ed1f5b13dbcdbd7909ca8bd49b5")

    depends_on("c", type="build")
    depends_on("cxx", type="build")
