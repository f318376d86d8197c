#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""consumers_test.py BIN PROGRAM: what pad writes, read by the program that it is for: vtk, f3d, liggghts or yade, as Debian
has them.

The part is a box of known mass off the origin. The spheres of its .npz are what the program must have found. Leaves with 77,
and a sentence, where the program is not there.
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy as np

BOX = [(x, y, z) for z in (0, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
FACES = ((4, 3, 2, 1), (5, 6, 7, 8), (1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (4, 1, 5, 8))


def skip(sentence):
    print(f"skipped: {sentence}")
    sys.exit(77)


def pad(*arguments):
    subprocess.run([PAD, "box.obj", "--tolerance", "3%", "-q", *arguments], check=True)


def run(command, **more):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300, **more)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)} failed:\n{done.stdout[-3000:]}")
    return done.stdout


def expect(what, found, wanted, tolerance):
    if not np.allclose(found, wanted, rtol=0, atol=tolerance):
        sys.exit(f"{what}: found\n{found}\nwanted\n{wanted}")
    print(f"{what}: {np.shape(wanted)} as wanted")


def sorted_rows(rows):
    rows = np.asarray(rows, dtype=float)
    return rows[np.lexsort(np.round(rows, 6).T)]


def vtk_reads(spheres):
    try:
        import vtk
        from vtk.util.numpy_support import vtk_to_numpy
    except ImportError:
        skip("VTK is not there (Debian: python3-vtk9)")
    print(f"VTK {vtk.VTK_VERSION}")
    low, high = (spheres[:, :3] - spheres[:, 3:]).min(0), (spheres[:, :3] + spheres[:, 3:]).max(0)

    def read(reader, file):  # not box.obj, which is the part itself
        pad("-o", file)
        reader.SetFileName(file)
        reader.Update()
        return reader.GetOutput()

    points = read(vtk.vtkXMLPolyDataReader(), "box.vtp")
    found = np.column_stack([vtk_to_numpy(points.GetPoints().GetData()), vtk_to_numpy(points.GetPointData().GetArray("radius"))])
    expect("vtp: spheres", found, spheres, 0)
    for ending, reader in (("stl", vtk.vtkSTLReader()), ("ply", vtk.vtkPLYReader()), ("obj", vtk.vtkOBJReader())):
        mesh = read(reader, f"spheres.{ending}")
        # An icosphere reaches 98 % of its radius at least in every direction.
        expect(f"{ending}: bounds", mesh.GetBounds(), np.column_stack([low, high]).ravel(), 0.02)
        if mesh.GetNumberOfCells() < 320:
            sys.exit(f"{ending}: only {mesh.GetNumberOfCells()} triangles")
    pad("-o", "box.glb", "--family", "3")
    gltf = vtk.vtkGLTFReader()
    gltf.SetFileName("box.glb")
    gltf.Update()
    box = vtk.vtkBoundingBox()

    def leaves(block):
        if block is not None and block.IsA("vtkMultiBlockDataSet"):
            return sum(leaves(block.GetBlock(k)) for k in range(block.GetNumberOfBlocks()))
        box.AddBounds(block.GetBounds())
        return 1
    expect("glb: meshes shown", leaves(gltf.GetOutput()), len(spheres), 0)
    bounds = [0.0] * 6
    box.GetBounds(bounds)  # glTF has Y up: our z is its y, our y is its -z
    expect("glb: bounds", bounds, [low[0], high[0], low[2], high[2], -high[1], -low[1]], 0.02)


def f3d_reads(spheres):
    if not shutil.which("f3d") or not shutil.which("xvfb-run"):
        skip("F3D is not there (Debian: f3d xvfb xauth)")
    low, high = (spheres[:, :3] - spheres[:, 3:]).min(0), (spheres[:, :3] + spheres[:, 3:]).max(0)
    x, y, z = (low + high) / 2
    for ending in ("stl", "ply", "obj", "glb"):
        pad("-o", f"spheres.{ending}")
        output = run(["xvfb-run", "-a", "f3d", f"spheres.{ending}", "--output", "seen.png", "--resolution", "200,200", "--verbose"])
        # It looks at the middle of what it shows. glTF has Y up.
        focal = next(line.split(":")[1] for line in output.splitlines() if line.startswith("Camera focal point"))
        expect(f"{ending}: middle", np.array(focal.split(","), dtype=float), [x, z, -y] if ending == "glb" else [x, y, z], 0.02)
        if os.path.getsize("seen.png") < 2000:
            sys.exit(f"{ending}: the picture shows nothing")


LIGGGHTS = """
atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
units si
region reg block -10 10 -10 10 -10 10 units box
create_box 1 reg
neighbor 0.1 bin
neigh_modify delay 0
fix m1 all property/global youngsModulus peratomtype 5.e6
fix m2 all property/global poissonsRatio peratomtype 0.45
fix m3 all property/global coefficientRestitution peratomtypepair 1 0.3
fix m4 all property/global coefficientFriction peratomtypepair 1 0.5
pair_style gran model hertz tangential history
pair_coeff * *
timestep 0.00001
fix ms all multisphere
fix part all particletemplate/multisphere 15485863 atom_type 1 density constant 2500 nspheres {count} ntry 1000000 spheres file box.txt scale 1.0 type 1
fix parts all particledistribution/discrete 15485867 1 part 1.0
fix ins all insert/pack seed 32452843 distributiontemplate parts insert_every once overlapcheck yes orientation constant 1 0 0 0 vel constant 0. 0. 0. particles_in_region 1 region reg
run 1
dump d all custom 1 spheres.dump x y z radius
run 0
"""


def liggghts_reads(spheres):
    if not shutil.which("liggghts"):
        skip("LIGGGHTS is not there (Debian: liggghts)")
    pad("--format", "liggghts", "-o", "box.txt")
    pad("-o", "box.spheres.json")
    pathlib.Path("in.box").write_text(LIGGGHTS.format(count=len(spheres)))
    environment = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    output = run(["liggghts", "-in", "in.box"], env=environment)
    print(output.splitlines()[0])
    # It measures the union itself, by a million random points.
    mass = float(output.split("inserted 1 particle templates (mass ")[1].split(")")[0])
    volume = json.loads(pathlib.Path("box.spheres.json").read_text())["volume_union"]
    expect("liggghts: volume", mass / 2500, volume, 0.005 * volume)
    dump = pathlib.Path("spheres.dump").read_text()
    found = np.array([line.split() for line in dump.split("radius \n")[-1].splitlines()], dtype=float)
    expect("liggghts: radii", np.sort(found[:, 3]), np.sort(spheres[:, 3]), 1e-5)
    # It turns a body into its own frame: what must agree is how far each sphere is from each other one.

    def distances(rows):
        order = rows[np.argsort(rows[:, 3], kind="stable")]
        return np.linalg.norm(order[:, None, :3] - order[None, :, :3], axis=2).sum(1)
    expect("liggghts: distances", np.sort(distances(found)), np.sort(distances(spheres)), 1e-3)


YADE = """
from runpy import run_path
from yade import *
from yade import ymport
O.materials.append(FrictMat(density=2500))
plain = ymport.textClumps("box.txt")[0]
clump, members = run_path("box.py")["append"]()
state = O.bodies[clump].state
turn = state.ori.toRotationMatrix()
moments = [state.inertia[0], state.inertia[1], state.inertia[2]]
tensor = [sum(turn[i, k] * moments[k] * turn[j, k] for k in range(3)) for i in range(3) for j in range(3)]
loose = [k for k in members if O.bodies[k].mask]
print("FOUND", O.bodies[plain[0]].state.mass, state.mass, *state.pos, *tensor)
print("SPHERES", *(x for k in loose for x in (*O.bodies[k].state.pos, O.bodies[k].shape.radius)))
ground = O.bodies.append(utils.wall(-3, axis=2))
O.engines = [ForceResetter(), InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Wall_Aabb()]),
             InteractionLoop([Ig2_Sphere_Sphere_ScGeom(), Ig2_Wall_Sphere_ScGeom()], [Ip2_FrictMat_FrictMat_FrictPhys()],
                             [Law2_ScGeom_FrictPhys_CundallStrack()]), NewtonIntegrator(gravity=(0, 0, -10), damping=0)]
for k in (*plain[1], plain[0]):
    O.bodies.erase(k)
O.dt = 1e-3
O.run(300, True)
print("FALLEN", state.vel[2])
import os, sys
sys.stdout.flush()
os._exit(0)
"""


def yade_reads(spheres):
    if not shutil.which("yade"):
        skip("YADE is not there (Debian: yade)")
    pad("--format", "yade", "-o", "box.txt")
    pathlib.Path("check.py").write_text(YADE)
    output = run(["yade", "-n", "-x", "check.py"])
    numbers = {}
    for line in output.splitlines():
        words = line.split()
        if words and words[0] in ("FOUND", "SPHERES", "FALLEN"):
            numbers[words[0]] = np.array(words[1:], dtype=float)
    if len(numbers) != 3:
        sys.exit(f"yade said only:\n{output[-3000:]}")
    found = numbers["FOUND"]
    mass = 2500 * 2
    print(f"the list alone weighs {found[0] / mass:.2f} times as much as the body")
    expect("yade: mass", found[1], mass, 1e-3)
    expect("yade: centre of mass", found[2:5], [0.5, 0.5, 1], 1e-6)
    expect("yade: inertia", found[5:], (mass / 12 * np.diag([5, 5, 2])).ravel(), 1e-2)
    expect("yade: spheres", sorted_rows(numbers["SPHERES"].reshape(-1, 4)), sorted_rows(spheres), 1e-9)
    expect("yade: speed after 0.3 s of falling", numbers["FALLEN"], [-3], 0.02)


PAD = os.path.join(os.path.abspath(sys.argv[1]), "pad")
with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    with open("box.obj", "w") as mesh:
        mesh.writelines(f"v {x} {y} {z}\n" for x, y, z in BOX)
        mesh.writelines("f {} {} {} {}\n".format(*face) for face in FACES)
    pad("-o", "box.npz")
    with np.load("box.npz") as arrays:
        wanted = np.column_stack([arrays["centers"], arrays["radii"]])
    {"vtk": vtk_reads, "f3d": f3d_reads, "liggghts": liggghts_reads, "yade": yade_reads}[sys.argv[2]](wanted)
