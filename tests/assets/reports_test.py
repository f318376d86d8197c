#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the programs print with --json is what the schemas in assets/reports say, and "-" is stdin and stdout.

Takes the folder of the programs and the root of the sources. The schemas are checked where python3-jsonschema is installed.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

try:
    import jsonschema
except ImportError:
    jsonschema = None

BIN, ROOT = (pathlib.Path(name).resolve() for name in sys.argv[1:3])
del sys.argv[1:3]
CUBE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n" \
       "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
ROBOT = """<robot name="arm"><link name="base"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<link name="hand"><collision><geometry><sphere radius="0.3"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="hand"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


class Case(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.write("cube.obj", CUBE)
        self.write("arm.urdf", ROBOT)

    def write(self, name, text):
        (self.folder / name).write_text(text)

    def run_tool(self, name, *args, stdin=None, code=0, env=None):
        done = subprocess.run([BIN / name, *args], cwd=self.folder, capture_output=True,
                              input=None if stdin is None else stdin.encode(), env=env)
        self.assertEqual(done.returncode, code, done.stderr.decode())
        return done.stdout, done.stderr.decode()


@unittest.skipUnless(jsonschema, "python3-jsonschema is not installed")
class ReportsTest(Case):
    @staticmethod
    def validator(name):
        schema = json.loads((ROOT / f"assets/reports/{name}.schema.json").read_text())
        kind = jsonschema.validators.validator_for(schema)
        kind.check_schema(schema)
        return kind(schema)

    def report(self, name, *args, code=0, **more):
        out, _ = self.run_tool(name, *args, "--json", code=code, **more)
        document = json.loads(out)
        self.validator(name).validate(document)
        return document

    def test_pad(self):
        one = self.report("pad", "cube.obj", "--density", "2", "--lod", "20%,10%")
        self.assertAlmostEqual(one["mass"], 2 * one["volume"])
        self.assertAlmostEqual(one["volume"], 1, delta=1e-6)
        self.report("pad", "cube.obj", "none.obj", "--tolerance", "10%", code=1)
        self.assertIn("error", self.report("pad", "cube.obj", "--depth", "7", code=2))
        self.report("pad", "cube.spheres.json", "-o", "cube.vtp")
        self.assertEqual(self.report("pad", "arm.urdf", "--tolerance", "10%", "--self-collision", "0")["robot"], "arm")
        (self.folder / "parts").mkdir()
        (self.folder / "cube.obj").rename(self.folder / "parts/cube.obj")
        self.assertEqual(self.report("pad", "parts", "-o", "out/", "--tolerance", "10%")["made"], 1)

    def test_detect_preview_and_settle(self):
        self.run_tool("pad", "cube.obj", "--tolerance", "10%", "-q")
        for more in ([], ["--memory", "1G"], ["--copies", "2", "--stages"]):
            self.report("detect", "cube.spheres.json", *more)
        self.report("detect", "none.json", code=1)
        self.report("preview", "cube.spheres.json", "-o", "c.png", "--size", "32x32", "--samples", "1")
        self.report("preview", "cube.spheres.json", "-o", "c.jpg", code=2)
        self.report("settle", "--make", "silo", "--count", "300", "-o", "silo.json")
        self.report("settle", "silo.json", "--steps", "3")
        self.report("settle", "none.json", code=1)

    def test_bench(self):
        for file in sorted((ROOT / "docs/results").rglob("*.json")):
            with self.subTest(file):
                self.validator("bench").validate(json.loads(file.read_text()))
        if not (BIN / "bench").exists():
            self.skipTest("bench is not built")
        stages = self.report("bench", "stages", "--spheres", "1000", "--backend", "omp", "--repeat", "1", "-o", "out", "-q")
        self.assertEqual(json.loads((self.folder / "out/stages.json").read_text()), stages)
        self.report("bench", "compare", "out/stages.json", "out/stages.json", "-q")
        self.report("bench", "compare", "out/stages.json", code=2)
        with self.assertRaises(jsonschema.ValidationError):
            self.validator("bench").validate({**stages, "rows": [{"seconds": -1}]})

    def test_what_is_no_report_is_refused(self):
        one = self.report("pad", "cube.obj", "--tolerance", "10%")
        for change in ({"spheres": -1}, {"within": "yes"}, {"accuracy": {}}, {"seconds": {}}):
            with self.subTest(change), self.assertRaises(jsonschema.ValidationError):
                self.validator("pad").validate({**one, **change})


class StreamsTest(Case):
    def two_cubes(self, apart):
        """The text of scene.json."""
        self.write("scene.json", json.dumps({"format": "padder.scene", "version": 1, "clusters": {"cube": "cube.spheres.json"},
                                             "bodies": [{"cluster": "cube", "position": [x, 0, 0]} for x in (0, apart)]}))
        return (self.folder / "scene.json").read_text()

    def test_a_mesh_from_stdin_and_the_asset_to_stdout(self):
        self.run_tool("pad", "cube.obj", "--tolerance", "10%", "-q")
        out, err = self.run_tool("pad", "-", "--input-format", "obj", "--tolerance", "10%", "-o", "-", stdin=CUBE)
        self.assertEqual(err, "")
        from_file = json.loads((self.folder / "cube.spheres.json").read_text())
        piped = json.loads(out)
        self.assertEqual(piped["spheres"], from_file["spheres"])
        self.assertEqual((piped["name"], piped["source"]["file"]), ("stdin", "stdin.obj"))
        out, _ = self.run_tool("pad", "-", "--input-format", "obj", "--tolerance", "10%", "-o", "piped.vtp", stdin=CUBE)
        self.assertTrue(out.startswith(b"stdin.obj: 12 triangles"), out)  # no temporary folder
        csv, _ = self.run_tool("pad", "cube.obj", "--tolerance", "10%", "-o", "-", "--format", "dem-engine")
        self.run_tool("pad", "cube.obj", "--tolerance", "10%", "-o", "cube.csv", "-q")
        self.assertEqual(csv, (self.folder / "cube.csv").read_bytes())

    def test_a_scene_from_stdin_and_the_contacts_to_stdout(self):
        self.run_tool("pad", "cube.obj", "--tolerance", "10%", "-q")
        scene = self.two_cubes(0.9)
        self.run_tool("detect", "scene.json", "-o", "contacts.csv", "-q")
        out, err = self.run_tool("detect", "-", "-o", "-", "--format", "csv", stdin=scene)  # names are relative to here
        self.assertEqual(out, (self.folder / "contacts.csv").read_bytes())
        self.assertEqual(err, "")
        self.assertGreater(out.count(b"\n"), 2)

    def test_a_cluster_or_a_scene_from_stdin_and_a_picture_to_stdout(self):
        self.run_tool("pad", "cube.obj", "--tolerance", "10%", "-q")
        cluster = (self.folder / "cube.spheres.json").read_text()
        scene = self.two_cubes(3)
        small = ["--size", "64x64", "--samples", "1"]
        for name, text, more in (("cube.spheres.json", cluster, []), ("scene.json", scene, []), ("cube.spheres.json", cluster, ["--copies", "3"])):
            with self.subTest((name, more)):
                self.run_tool("preview", name, "-o", "file.png", "-q", *small, *more)
                out, err = self.run_tool("preview", "-", "-o", "-", "--format", "png", *small, *more, stdin=text)
                self.assertEqual(err, "")
                self.assertEqual(out, (self.folder / "file.png").read_bytes())

    def test_what_scripts_say_of_colours_is_taken(self):
        self.run_tool("pad", "cube.obj", "--tolerance", "10%", "--color=never")
        for name, args in (("detect", ["cube.spheres.json"]), ("preview", ["cube.spheres.json", "-o", "c.html"]), ("bench", ["--list"]),
                           ("settle", ["--make", "silo", "--count", "300", "-o", "silo.json"])):
            if (BIN / name).exists():
                self.run_tool(name, *args, "--colour", "never")
        self.assertIn("never", self.run_tool("detect", "cube.spheres.json", "--colour", "green", code=2)[1])

    def test_what_streams_cannot_do_is_a_sentence(self):
        for name, args, stdin, code, words in (
                ("pad", ["-"], CUBE, 2, "--input-format stl"),
                ("pad", ["-", "--input-format", "docx"], CUBE, 2, "--input-format"),
                ("pad", ["cube.obj", "--input-format", "obj"], None, 2, "MESH -"),
                ("pad", ["-", "-", "--input-format", "obj"], CUBE, 2, "twice"),
                ("pad", ["cube.obj", "-o", "-", "--json"], None, 2, "--json"),
                ("pad", ["cube.obj", "-o", "-", "--format", "yade", "--tolerance", "10%"], None, 1, "more than one file"),
                ("pad", ["-", "--input-format", "obj"], "", 1, "is empty"),
                ("pad", ["-", "--input-format", "obj"], "v 0 0", 1, "pad: stdin.obj"),
                ("pad", ["-", "--input-format", "obj", "--visual"], CUBE, 2, "and stdin.obj is none"),
                ("detect", ["-", "-o", "-"], "{", 2, "--format csv"),
                ("detect", ["-"], "{", 1, "the standard input"),
                ("detect", ["-", "--format", "csv"], "{", 2, "-o -"),
                ("preview", ["-", "-o", "-"], "", 2, "--format html"),
                ("preview", ["-", "-o", "a.png", "--format", "png"], "{", 2, "-o -"),
                ("preview", ["-", "-o", "-", "--format", "png", "--json"], "{", 2, "--json"),
                ("preview", ["-", "-o", "-", "--format", "png"], "{", 1, "the standard input")):
            with self.subTest((name, args)):
                env = {**os.environ, "TMPDIR": str(self.folder)}
                _, err = self.run_tool(name, *args, stdin=stdin, code=code, env=env)
                self.assertIn(words, err)
                self.assertEqual(err.count("\n"), 1, err)
                self.assertEqual(sorted(os.listdir(self.folder)), ["arm.urdf", "cube.obj"])  # and nothing is left behind

    def test_the_seconds_of_each_step_on_stderr(self):
        _, err = self.run_tool("pad", "cube.obj", "--tolerance", "10%", "-q", "-v")
        self.assertEqual([line.split()[1] for line in err.splitlines()],
                         ["read", "repair", "remesh", "fit", "refit", "cull", "accuracy", "total"])
        _, err = self.run_tool("detect", "cube.spheres.json", "-q", "-v")
        self.assertIn("detect: total", err)

    def test_the_mass_is_printed(self):
        out, _ = self.run_tool("pad", "cube.obj", "--tolerance", "10%", "--unit", "m", "--density", "7850")
        self.assertIn("volume 1 m^3, mass 7850 kg at a density of 7850 kg/m^3", out.decode())


if __name__ == "__main__":
    unittest.main()
