# SPDX-License-Identifier: MIT
"""Spack's recipe: spack repo add tools/packaging/spack && spack install padder."""
import pathlib

from spack.package import *


class Padder(CMakePackage, CudaPackage):
    """Triangle meshes to clusters of spheres, and a GPU collision detector that consumes them."""

    license("MIT AND GPL-3.0-or-later")

    git = f"file://{pathlib.Path(__file__).resolve().parents[5]}"  # the checkout that this recipe lies in

    version("main", get_full_repo=False)

    variant("padding", default=True, description="meshes to clusters (CGAL: GPL)")
    variant("tools", default=True, description="the programs", when="+padding")
    variant("python", default=False, description="the Python module", when="+padding")
    variant("mpi", default=False, description="contacts across machines")
    variant("font", default="/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf", values=lambda path: path.endswith(".ttf"),
            description="the font of the legends in pictures, which becomes part of the library", when="+tools")

    depends_on("cxx", type="build")
    depends_on("cmake@3.25:", type="build")
    depends_on("ninja", type="build")
    depends_on("eigen@3.4:3")
    depends_on("nlohmann-json")
    depends_on("pugixml")
    depends_on("yaml-cpp")
    depends_on("zlib-api")
    with when("+padding"):
        depends_on("cgal@5.5:5")
        depends_on("assimp")
        depends_on("tinyobjloader@2:")
        depends_on("openssl")
    with when("+tools"):
        depends_on("cli11")
        depends_on("embree@3")
        depends_on("libpng")
        depends_on("freetype")
    with when("+python"):
        extends("python@3.9:")
        depends_on("py-pybind11", type="build")
        depends_on("py-numpy", type=("build", "run"))
    depends_on("mpi", when="+mpi")
    depends_on("trilinos+zoltan", when="+mpi")

    generator("ninja")

    def cmake_args(self):
        args = [
            self.define_from_variant("PADDER_PADDING", "padding"),
            self.define_from_variant("PADDER_TOOLS", "tools"),
            self.define_from_variant("PADDER_VIEW", "tools"),
            self.define("PADDER_PYTHON_MODULE", "ON" if self.spec.satisfies("+python") else "OFF"),
            self.define("PADDER_MPI", "ON" if self.spec.satisfies("+mpi") else "OFF"),
            self.define("PADDER_CUDA", "ON" if self.spec.satisfies("+cuda") else "OFF"),
            self.define("PADDER_TESTS", False),
        ]
        if self.spec.satisfies("+tools"):
            args.append(self.define_from_variant("PADDER_FONT", "font"))
        if self.spec.satisfies("+cuda") and self.spec.variants["cuda_arch"].value[0] != "none":
            args.append(self.define("CMAKE_CUDA_ARCHITECTURES", list(self.spec.variants["cuda_arch"].value)))
        return args

    @run_after("install")
    def install_python(self):
        if self.spec.satisfies("+python"):  # the module is a part of its own (tools/python/CMakeLists.txt)
            cmake("--install", self.build_directory, "--component", "python")
