#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line of preview, and of pad --preview: what is written, exit codes, sentences. Takes the programs' folder."""
import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

BIN = os.path.abspath(sys.argv.pop(1))
PAGE = os.path.exists(os.path.join(BIN, "..", "page", "page.html"))


class PreviewTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "tetra.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
        self.write("ball.spheres.json", {"format": "padder.cluster", "version": 1, "name": "ball", "spheres": {"centers": [[0, 0, 0]], "radii": [1]}})
        self.write("scene.json", {"format": "padder.scene", "version": 1, "clusters": {"ball": "ball.spheres.json"},
                                  "bodies": [{"cluster": "ball", "position": [x, 0, 0]} for x in (0, 1.5)]})

    def write(self, name, document):
        (self.folder / name).write_text(json.dumps(document))

    def run_tool(self, name, *args, code=0):
        done = subprocess.run([os.path.join(BIN, name), *args], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, code, done.stderr)
        if code:
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)  # one sentence
            if "--json" not in args:
                self.assertEqual(done.stdout, "")
        return done

    def preview(self, *args, code=0):
        return self.run_tool("preview", *args, code=code)

    def pictured(self, *args, size="64x64"):
        """What preview reports of a small picture, quickly drawn, and what it warns of."""
        done = self.preview(*args, "--size", size, "--samples", "1", "--json")
        return json.loads(done.stdout), done.stderr

    def bytes_of(self, name):
        return (self.folder / name).read_bytes()

    def size_of(self, name):
        head = self.bytes_of(name)[:24]
        self.assertEqual(head[:8], b"\x89PNG\r\n\x1a\n")
        return struct.unpack(">II", head[16:])

    def test_a_picture_of_the_size_asked_for(self):
        out = self.preview("ball.spheres.json", "-o", "ball.png", "--size", "120x80", "--samples", "2", "--json").stdout
        self.assertEqual(self.size_of("ball.png"), (120, 80))
        report = json.loads(out)
        self.assertEqual((report["kind"], report["spheres"], report["triangles"]), ("picture", 1, 0))
        self.assertEqual(report["bytes"], len(self.bytes_of("ball.png")))

    def test_pad_shows_what_it_made(self):
        # One picture of this size takes ten processor seconds.
        self.run_tool("pad", "tetra.obj", "--edge-length", "20%", "--preview", "pictures/", "-q", "--colour", "gap")
        self.assertEqual(self.size_of("pictures/tetra.png"), (1600, 800))
        self.run_tool("pad", "tetra.obj", "--preview", "tetra.jpg", code=2)
        self.run_tool("pad", "tetra.obj", "tetra.obj", "--preview", "tetra.png", code=2)
        # The mesh is found again by its name and bytes; under another name it must be told.
        self.assertEqual(self.pictured("tetra.spheres.json", "-o", "again.png")[0]["triangles"], 4)
        (self.folder / "tetra.obj").rename(self.folder / "moved.obj")
        report, warning = self.pictured("tetra.spheres.json", "-o", "again.png")
        self.assertEqual(report["triangles"], 0)
        self.assertIn("--mesh", warning)
        report, warning = self.pictured("tetra.spheres.json", "--mesh", "moved.obj", "-o", "again.png")
        self.assertEqual((report["triangles"], warning), (4, ""))

    def test_a_picture_draws_one_level_of_a_ladder(self):
        self.run_tool("pad", "tetra.obj", "--lod", "10%,4%", "-q")
        ladder = json.loads(self.bytes_of("tetra.spheres.json"))
        counts = [ladder["spheres"]["count"], ladder["lods"][0]["spheres"]["count"]]
        self.assertGreater(counts[0], counts[1])
        pictures = []
        for level, count in enumerate(counts):
            report, _ = self.pictured("tetra.spheres.json", "-o", "l.png", "--lod", str(level), size="96x48")
            self.assertEqual((report["spheres"], report["levels"]), (count, 2))
            pictures.append(self.bytes_of("l.png"))
        self.assertNotEqual(*pictures)
        # The finest alone gives the picture of a cluster that holds nothing else.
        del ladder["lods"]
        self.write("alone.spheres.json", ladder)
        self.pictured("alone.spheres.json", "-o", "l.png", size="96x48")
        self.assertEqual(self.bytes_of("l.png"), pictures[0])
        for ending in ("png", "html") if PAGE else ("png",):
            self.assertIn("2 levels", self.preview("tetra.spheres.json", "-o", "l." + ending, "--lod", "2", code=1).stderr)
        for wrong in ("x", "-1"):
            self.preview("tetra.spheres.json", "-o", "l.png", "--lod", wrong, code=2)

    def test_scene_and_copies(self):
        self.assertEqual(self.pictured("scene.json", "-o", "s.png", "--colour", "body")[0]["bodies"], 2)
        self.assertEqual(self.pictured("ball.spheres.json", "--copies", "5", "-o", "s.png")[0]["spheres"], 5)

    def test_a_file_of_spheres(self):
        header = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 4), }"
        (self.folder / "s.npy").write_bytes(
            b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + header.ljust(117).encode() + b"\n" + struct.pack("<8f", 0, 0, 0, 1, 3, 0, 0, 1))
        self.assertEqual(self.pictured("s.npy", "-o", "s.png")[0]["spheres"], 2)

    @unittest.skipUnless(PAGE, "the page is not built")
    def test_contacts_of_both_kinds_give_one_page(self):
        pages = []
        for ending in ("csv", "npz"):
            self.run_tool("detect", "scene.json", "-o", "c." + ending, "-q")
            self.preview("scene.json", "--contacts", "c." + ending, "-o", "s.html", "-q")
            pages.append(self.bytes_of("s.html"))
        self.assertEqual(pages[0], pages[1])
        self.assertIn(b'id="pairs"', pages[0])

    def test_wrong_usage_is_2_and_writes_nothing(self):
        for args in (["ball.spheres.json"], ["ball.spheres.json", "-o", "a.jpg"], ["ball.spheres.json", "-o", "a.png", "--size", "5x5"],
                     ["ball.spheres.json", "-o", "a.png", "--size", "64x64x2"], ["ball.spheres.json", "-o", "a.png", "--show", "all"],
                     ["ball.spheres.json", "-o", "a.png", "--from", "0", "90"], ["ball.spheres.json", "-o", "a.png", "--from", "1e300", "0"],
                     ["ball.spheres.json", "-o", "a.png", "--from=-36001", "0"], ["scene.json", "-o", "a.png", "--mesh", "tetra.obj"],
                     ["ball.spheres.json", "-o", "a.png", "--up", "w"], ["-o", "a.png"]):
            with self.subTest(args):
                self.preview(*args, code=2)
        self.assertFalse((self.folder / "a.png").exists())

    def test_wrong_usage_says_what_is_taken(self):
        for args, sentence in ((["--show", "cube"], '--show takes one of both, mesh, side, spheres and wire, not "cube"'),
                               (["--up", "w"], '--up takes one of x, y and z, not "w"'),
                               (["--lod", "-1"], '--lod takes a whole number, 0 or more, not "-1"'),
                               (["--samples", "1.5"], '--samples takes a whole number from 1 to 4096, not "1.5"'),
                               (["--from", "1", "b"], '--from: "b" is no decimal number'),
                               (["--from", "10", "0x10"], '--from: "0x10" is no decimal number'),
                               (["--samples", "010"], '--samples: "010" is no whole number in decimal digits without a leading zero'),
                               (["--copies", "0x10"], '--copies: "0x10" is no whole number in decimal digits without a leading zero'),
                               (["--from", "1"], "--from takes 2 numbers, and fewer are given")):
            with self.subTest(args):
                said = self.preview("ball.spheres.json", "-o", "a.png", *args, code=2).stderr
                self.assertEqual(said, "preview: " + sentence + " (see preview --help)\n")

    def test_json_tells_failures(self):
        for args in (["absent.spheres.json", "-o", "a.png"], ["ball.spheres.json", "-o", "no/such/folder.png", "--size", "32x32"]):
            with self.subTest(args):
                ran = self.preview(*args, "--json", code=1)
                self.assertEqual(ran.stderr, "preview: " + json.loads(ran.stdout)["error"] + "\n")
                self.assertEqual(json.loads(ran.stdout)["input"], args[0])

    def test_failures_are_1_and_name_the_file(self):
        texts = {"nothing.csv": "", "header.csv": "i,j\n", "number.csv": "i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz\n0,1,0,0,x\n",
                 "other.csv": "i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz\n0,9,1,0,0,.1,0,0,0,0,0,0\n", "not.npz": "PK", "c.txt": ""}
        for name, text in texts.items():
            (self.folder / name).write_text(text)
            with self.subTest(name):
                self.assertIn(name, self.preview("scene.json", "--contacts", name, "-o", "a.png", code=1).stderr)
        (self.folder / "broken.json").write_text('{"format": "padder.cluster"')
        for name in ("absent.spheres.json", "broken.json", "."):
            with self.subTest(name):
                self.assertIn(name, self.preview(name, "-o", "a.png", code=1).stderr)
        self.assertIn("is a mesh: make spheres of it first, with pad tetra.obj", self.preview("tetra.obj", "-o", "a.png", code=2).stderr)
        self.assertIn("absent.obj", self.preview("ball.spheres.json", "--mesh", "absent.obj", "-o", "a.png", code=1).stderr)
        self.preview("ball.spheres.json", "-o", "no/such/folder.png", "--size", "32x32", code=1)
        self.preview("ball.spheres.json", "-o", "a.png", "--colour", "protrusion", code=1)
        self.assertFalse((self.folder / "a.png").exists())


if __name__ == "__main__":
    unittest.main()
