#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The recipes for Spack and conda are well-formed, name options that exist and every library that the build looks for.

Spack and conda themselves are not run. Takes nothing.
"""
import ast
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
RECIPES = ROOT / "tools" / "packaging"
# find_package of CMake, and the name in Spack and in conda-forge. None: part of another package or of the compiler.
NAMES = {
    "Eigen3": ("eigen", "eigen"), "nlohmann_json": ("nlohmann-json", "nlohmann_json"), "pugixml": ("pugixml", "pugixml"),
    "yaml-cpp": ("yaml-cpp", "yaml-cpp"), "ZLIB": ("zlib-api", "zlib"), "CGAL": ("cgal", "cgal-cpp"), "assimp": ("assimp", "assimp"),
    "tinyobjloader": ("tinyobjloader", "tinyobjloader"), "OpenSSL": ("openssl", "openssl"), "CLI11": ("cli11", "cli11"),
    "embree": ("embree", "embree"), "PNG": ("libpng", "libpng"), "Freetype": ("freetype", "freetype"),
    "pybind11": ("py-pybind11", "pybind11"), "Python": ("python", "python"), "MPI": ("mpi", None), "OpenMP": (None, None),
    "CUDAToolkit": (None, None), "Bullet": (None, None), "fcl": (None, None), "Threads": (None, None), "Python3": (None, None),
}


def cmake_files():
    return [ROOT / "CMakeLists.txt", *(p for room in ("padding", "detect", "tools") for p in (ROOT / room).rglob("CMakeLists.txt"))]


class Recipes(unittest.TestCase):
    def setUp(self):
        self.spack = (RECIPES / "spack" / "packages" / "padder" / "package.py").read_text()
        self.meta = (RECIPES / "conda" / "meta.yaml").read_text()
        self.build = (RECIPES / "conda" / "build.sh").read_text()
        self.cmake = "\n".join(p.read_text() for p in cmake_files())

    def test_options_exist(self):
        known = set(re.findall(r"^(?:option\(|set\(|find_file\()(PADDER_\w+)", self.cmake, re.MULTILINE))
        used = set(re.findall(r"PADDER_\w+", self.spack + self.build))
        self.assertGreater(len(used), 5)
        self.assertEqual(used - known, set())

    def test_every_library_is_named(self):
        # Names that are all capitals in a variable, as ${NAME}, are not packages.
        wanted = set(re.findall(r"find_package\((\w[\w-]*)", self.cmake))
        self.assertEqual(wanted - set(NAMES), set(), "name the package in this test and in the recipes")
        spack = set(re.findall(r'(?:depends_on|extends)\("([\w-]+)', self.spack))
        conda = set(re.findall(r"^    - ([\w-]+)", self.meta, re.MULTILINE))
        for package in wanted:
            for name, there in zip(NAMES[package], (spack, conda)):
                if name:
                    self.assertIn(name, there, package)

    def test_they_are_well_formed(self):
        kinds = {node.name: [ast.unparse(b) for b in node.bases] for node in ast.walk(ast.parse(self.spack)) if isinstance(node, ast.ClassDef)}
        self.assertEqual(kinds, {"Padder": ["CMakePackage", "CudaPackage"]})
        try:
            import yaml
        except ImportError:
            self.skipTest("python3-yaml is not installed")
        plain = re.sub(r"\{%.*?%\}", "", self.meta).replace('{{ compiler("cxx") }}', "cxx").replace("{{ version }}", "0")
        recipe = yaml.safe_load(plain)
        self.assertEqual((RECIPES / "conda" / recipe["source"]["path"]).resolve(), ROOT)
        pattern = re.search(r'regex_pattern="(.*?)"\)', self.meta).group(1).encode().decode("unicode_escape")
        self.assertRegex(re.search(pattern, (ROOT / "CMakeLists.txt").read_text()).group(1), r"^\d+\.\d+\.\d+$")


if __name__ == "__main__":
    unittest.main()
