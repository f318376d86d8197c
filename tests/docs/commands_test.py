#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""commands_test.py ROOT BUILD: what docs/ promises in at most four commands is done by those commands.

The commands are read from the page and run by a shell in a folder that looks like a fresh clone. tools/run is replaced by the program
that is built already, pip builds in BUILD, what Debian has is not installed again, and notebook is replaced by nbclient, which runs the
cells without a browser. Parts whose programs are not there are skipped, with a sentence.
"""
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT, BUILD = (pathlib.Path(p).resolve() for p in sys.argv[1:3])
del sys.argv[1:3]
RUN_NOTEBOOK = """
import nbclient, nbformat, sys
book = nbformat.read(sys.argv[1], 4)
nbclient.NotebookClient(book, timeout=300, resources={"metadata": {"path": "."}}).execute()
nbformat.write(book, "ran.ipynb")
"""


def commands_of(page, heading):
    text = (ROOT / "docs" / page).read_text()
    section = text.split(f"## {heading}\n", 1)[1].split("\n## ", 1)[0]
    return [line.strip() for line in re.search(r"(?:^ {4}.*\n)+", section, re.MULTILINE).group().splitlines()]


class Commands(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        for entry in ROOT.iterdir():
            if entry.name not in (".git", "build"):
                (self.folder / entry.name).symlink_to(entry)

    def run_page(self, page, heading):
        """Runs them all, and returns what the last one printed."""
        commands = commands_of(page, heading)
        self.assertLessEqual(len(commands), 4)
        for command in commands:
            if command.startswith("sudo apt-get install"):
                continue
            command = command.replace("tools/run ", f"{BUILD}/bin/").replace("-m notebook ", f"-c {shlex.quote(RUN_NOTEBOOK)} ")
            command = command.replace("python3 -m venv", "/usr/bin/python3 -m venv")
            env = {**os.environ, "PADDER_BUILD_DIR": str(BUILD), "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                   "PIP_NO_INDEX": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
            env.pop("PYTHONPATH", None)
            done = subprocess.run(["bash", "-c", command], cwd=self.folder, capture_output=True, text=True, env=env, timeout=500)
            self.assertEqual(done.returncode, 0, f"{command}\n{done.stdout[-2000:]}{done.stderr[-3000:]}")
        return done.stdout

    def test_a_clump_in_liggghts(self):
        if not shutil.which("liggghts"):
            self.skipTest("LIGGGHTS is not installed (apt-get install liggghts)")
        self.run_page("formats.md", "A clump in LIGGGHTS")
        frames = (self.folder / "grains.dump").read_text().split("ITEM: TIMESTEP\n")[1:]
        rows = [[float(v) for v in line.split()] for line in frames[-1].splitlines()[8:]]
        first = [[float(v) for v in line.split()] for line in frames[0].splitlines()[8:]]
        self.assertEqual(len(rows), 80)  # 40 grains of 2 spheres
        height = lambda rows: sum(row[3] for row in rows) / len(rows)
        self.assertLess(height(rows), height(first) - 0.003)  # they fall: 8 mm in 0.04 s but for the floor
        self.assertTrue(all(abs(v) < 0.03 for row in rows for v in row[1:3]))

    def test_a_robot_in_mujoco(self):
        if not shutil.which("mujoco-testspeed"):
            self.skipTest("MuJoCo's programs are not installed (apt-get install libmujoco-samples)")
        printed = self.run_page("formats.md", "A robot in MuJoCo")
        self.assertIn("Running 10000 steps", printed)
        self.assertRegex(printed, r"Degrees of freedom +: 2\n")

    def test_an_asset_in_a_notebook(self):
        for module in ("nbclient", "ipykernel", "venv", "ensurepip", "numpy"):
            if subprocess.run(["/usr/bin/python3", "-c", f"import {module}"], capture_output=True).returncode:
                self.skipTest(f"Debian's Python has no {module}")
        self.run_page("python.md", "An asset in a notebook")
        with open(self.folder / "ran.ipynb") as f:
            cells = [c for c in json.load(f)["cells"] if c["cell_type"] == "code"]
        html = "".join(cells[0]["outputs"][0]["data"]["text/html"])
        self.assertIn("<th style='text-align:left'>spheres</th>", html)
        if (BUILD / "page" / "page.html").exists():
            self.assertIn("<iframe", html)
            self.assertIn("&lt;canvas", html)
            self.assertIn("track_shoe", (self.folder / "track_shoe.html").read_text())
        self.assertIn("True", "".join(cells[1]["outputs"][0]["data"]["text/plain"]))


if __name__ == "__main__":
    unittest.main()
