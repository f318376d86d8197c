#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""corpus.py OUT BIN: seeds for the fuzz targets: the small meshes of the tests, what pad exports of a cube, and scenes."""
import json
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
CUBE = ("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n"
        "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n")
ENDINGS = ("spheres.json", "csv", "npz", "vtp", "yaml", "xrdf", "srdf", "xml", "urdf")


def main(out, programs):
    out = pathlib.Path(out)
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    for folder in (*(pathlib.Path(programs).parent / "data").iterdir(), ROOT / "tests/data/robot"):
        for file in folder.rglob("*"):
            if file.is_file() and file.stat().st_size < 20000:
                shutil.copy(file, out / f"{folder.name}_{file.name}")
    (out / "cube.obj").write_text(CUBE)
    for ending in ENDINGS:
        subprocess.run([f"{programs}/pad", out / "cube.obj", "-q", "--tolerance", "20%", "--effort", "0", "-o", out / f"cube.{ending}"], check=True)
    for name in ("liggghts", "yade"):
        subprocess.run([f"{programs}/pad", out / "cube.obj", "-q", "--tolerance", "20%", "--effort", "0", "--format", name, "-o", out / f"{name}.txt"],
                       check=True)
    (out / "loose.csv").write_text("# a comment\nx,y,z,r,family,mask\n0,0,0,1,1,0\n1.5,0,0,1,2,4\n-3e5,1e-9,0,0.25,0,0\n")
    shutil.copy(ROOT / "assets/worked_example.json", out / "worked.scene.json")
    scene = {"format": "padder.scene", "version": 1, "spheres": [
        {"centers": [[0, 0, 0], [1, 0, 0]], "radii": [1, 0.5], "family": [1, 2], "mask": [0, 1], "world": "every", "static": True},
        {"generate": "dense", "count": 5, "order": "coherent"}]}
    (out / "loose.scene.json").write_text(json.dumps(scene))
    (out / "links.urdf").write_text(
        '<?xml version="1.0"?>\n<robot name="r"><link name="a"><collision><origin xyz="0 0 1" rpy="0 1 0"/><geometry><box size="1 2 3"/></geometry>'
        '</collision></link><link name="b"><collision><geometry><cylinder radius="1" length="2"/></geometry></collision><collision><geometry>'
        '<sphere radius="1"/></geometry></collision></link><joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
        '</joint></robot>\n')


if __name__ == "__main__":
    main(*sys.argv[1:])
