#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""settle_tool_test.py BIN    runs the program settle as a user does: scenes made, settled, resumed, shown, refused."""
import base64
import json
import math
import os
import re
import struct
import subprocess
import sys
import tempfile
import unittest.mock
import zipfile
import zlib

BIN = sys.argv[1]


def run(*arguments, code=0):
    done = subprocess.run([os.path.join(BIN, arguments[0]), *map(str, arguments[1:])], capture_output=True, text=True)
    assert done.returncode == code, (arguments, done.returncode, done.stdout, done.stderr)
    return done


def run_code(*arguments):
    return subprocess.run([os.path.join(BIN, arguments[0]), *map(str, arguments[1:])], capture_output=True).returncode


def report(*arguments):
    return json.loads(run("settle", *arguments, "--json").stdout)


def refused(part, *arguments, code=1):
    said = run("settle", *arguments, code=code).stderr
    assert part in said and said.count("\n") == 1, said


SCENE = {"format": "padder.scene", "version": 1}
# Two spheres as one part, written by hand: a cluster without mass properties counts as if its spheres did not overlap.
CLUSTER = {"format": "padder.cluster", "version": 1, "name": "pill", "unit": "m",
           "spheres": {"centers": [[-0.01, 0, 0], [0.01, 0, 0]], "radii": [0.01, 0.01]}}


def scene_of(**settle):
    bodies = [{"cluster": "pill", "position": [0.03 * (k % 3), 0.03 * (k // 3), 0.03],
               "quaternion": [0.6, 0, 0.8, 0]} for k in range(6)]
    return {**SCENE, "unit": "m", "clusters": {"pill": "pill.spheres.json"}, "bodies": bodies,
            "spheres": [{"centers": [[0.015, 0.015, 0.09], [0.045, 0.015, 0.09]], "radii": 0.009}],
            "settle": {"duration": 0.2, "material": {"stiffness": 1e4}, "planes": [dict(FLOOR[0])], **settle}}


FLOOR = [{"point": [0, 0, 0], "normal": [0, 0, 1]}]


def write(name, document):
    with open(name, "w") as f:
        json.dump(document, f)


def report_of(scene, *arguments):
    write("scene.json", scene)
    return report("scene.json", *arguments)


def refused_scene(part, scene, *arguments):
    write("scene.json", scene)
    refused(part, "scene.json", *arguments)


def check_frames(page, files):
    """The frames of a page beside the same frames as .npz."""
    head = json.loads(page.split("const head = ")[1].split(";\n")[0])
    frames = re.findall(r'"([^"]*)",\n', page.split("const packed = [")[1].split("]")[0])
    assert len(frames) == len(files) == len(head["times"]), (len(frames), files)
    n, at = head["spheres"], [0] * (3 * head["spheres"])
    for frame, file in zip(frames, files):
        moved = zlib.decompress(base64.b64decode(frame))
        assert len(moved) == 6 * n
        for k in range(3 * n):
            folded = moved[k] | moved[3 * n + k] << 8
            at[k] += folded >> 1 ^ -(folded & 1)
        raw = zipfile.ZipFile(file).read("centers.npy")
        centers = struct.unpack(f"<{3 * n}d", raw[-24 * n:])
        for k in range(3 * n):
            axis = k // n
            shown = head["low"][axis] + (at[k] & 65535) * head["step"][axis]
            assert abs(shown - centers[3 * (k % n) + axis]) < 0.51 * head["step"][axis] + 1e-6, (file, k)


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    write("pill.spheres.json", CLUSTER)
    write("pills.json", scene_of())

    whole = report("pills.json", "-o", "out.npz", "--frames", 3)
    assert (whole["bodies"], whole["grains"], whole["spheres"], whole["frames"]) == (6, 2, 14, 3), whole
    assert whole["contacts"] >= 3 and whole["penetration_ratio"] < 0.2, whole
    assert whole["energy"]["potential"] < whole["energy"]["first"], whole
    assert sorted(f for f in os.listdir() if f.startswith("out")) == ["out_0000.npz", "out_0001.npz", "out_0002.npz"]
    assert {"centers.npy", "radii.npy", "family.npy", "velocities.npy"} <= set(zipfile.ZipFile("out_0002.npz").namelist())
    # What settle writes, detect reads; what settle reads, detect reads.
    assert json.loads(run("detect", "out_0002.npz", "--json").stdout)["spheres"] == 14
    assert json.loads(run("detect", "pills.json", "--json").stdout)["bodies"] == 6

    # The same bits: twice, with other threads and skins, and over a checkpoint.
    half = whole["steps"] // 2
    assert report("pills.json")["state"] == whole["state"]
    assert report("pills.json", "--threads", 2, "--skin", 0)["state"] == whole["state"]
    if whole["backend"] == "omp":
        assert report("pills.json", "--backend", "omp")["state"] == whole["state"]
    if run_code("settle", "pills.json", "--backend", "cuda", "--steps", 1) != 0:
        refused("choose omp", "pills.json", "--backend", "cuda")
    report("pills.json", "--steps", half, "--checkpoint", "half.npz")
    rest = report("pills.json", "--resume", "half.npz")
    assert rest["steps"] == whole["steps"] and rest["state"] == whole["state"], (rest, whole)

    # No step at all: a checkpoint becomes a frame. A state at rest goes on, and what it wrote begins a scene.
    none = report("pills.json", "--resume", "half.npz", "--steps", 0, "-o", "still.npz")
    assert (none["steps"], none["frames"]) == (half, 1), none
    ball = {**SCENE, "spheres": [{"centers": [[0, 0, 0.5]], "radii": 0.5}], "settle": {"planes": FLOOR, "duration": 2}}
    write("ball.json", ball)
    # Gravity and density that are not given are the same in every unit.
    metre = report("ball.json")
    milli = report_of({**ball, "unit": "mm", "spheres": [{"centers": [[0, 0, 500]], "radii": 500}]})
    assert milli["steps"] == metre["steps"] and abs(milli["energy"]["potential"] / metre["energy"]["potential"] - 1e6) < 10, (metre, milli)
    assert report("ball.json", "--checkpoint", "ball.npz", "-o", "lying.npz")["at_rest"]
    assert report("ball.json", "--resume", "ball.npz", "--steps", 100)["at_rest"]
    lying = report("ball.json", "--resume", "ball.npz", "--steps", 0)
    assert lying["contacts"] == 1 and lying["penetration"] > 0 and lying["at_rest"], lying
    fresh = report("ball.json", "--steps", 0)
    assert fresh["contacts"] == 1 and not fresh["at_rest"], fresh
    assert report_of({**ball, "spheres": [{"file": "lying_0000.npz"}]}, "--steps", 100)["at_rest"]
    # What hangs in the air, turns back there or spins is not at rest, however often the run is looked at.
    hung = {**SCENE, "unit": "m", "spheres": [{"centers": [[0, 0, 0.00999], [0.1, 0, 0.5]], "radii": 0.01}],
            "settle": {"planes": FLOOR, "duration": 1.5}}
    write("hung.json", hung)
    for looks in ([], ["--frames", 2000, "-o", "hung.html"]):
        fallen = report("hung.json", "--until-rest", "--checkpoint", "hung.npz", *looks)
        assert fallen["at_rest"] and 0.7 < fallen["time"] < 1.5 and fallen["contacts"] == 2, fallen
    assert report("hung.json", "--until-rest", "--steps", 10**9)["time"] < 1.5, "a long run goes on at rest"
    assert not report("hung.json", "--steps", 400, "--until-rest")["at_rest"]
    assert report("hung.json", "--resume", "hung.npz", "--steps", 0)["at_rest"]
    hung_pills = {**hung, "clusters": {"pill": "pill.spheres.json"}, "spheres": []}
    top = {**hung_pills, "bodies": [{"cluster": "pill", "position": [0, 0, 0.00999]}],
           "settle": {**hung["settle"], "material": {"friction": 0}, "bodies": [{"body": 0, "spin": [0, 0, 3]}], "duration": 0.5}}
    assert not report_of(top, "--until-rest")["at_rest"]
    # The deepest penetration is that of the run, not of its end; what is too deep is told, and which stiffness helps.
    def pressed(**material):
        write("deep.json", {**hung, "spheres": [{"centers": [[0, 0, 1]], "radii": 0.01}],
                            "settle": {**hung["settle"], "material": material, "duration": 0.6}})
        told = run("settle", "deep.json", "--json")
        assert json.loads(told.stdout)["contacts"] == 0, told
        return json.loads(told.stdout)["penetration_ratio"], told.stderr
    ratio, said = pressed()
    assert ratio > 0.5, ratio
    stiffness = float(re.search(r'a "stiffness" of about (\S+) in "material"', said).group(1))
    ratio, said = pressed(stiffness=stiffness)
    assert ratio < 0.11 and "stiffness" not in said, (ratio, said)
    # What is a tenth but for rounding is not told: the stiffness that helps would be the one that is.
    ratio, said = pressed(stiffness=stiffness * (ratio / 0.102) ** 2)
    assert 0.1 < ratio < 0.105 and said == "", (ratio, said)
    # A frame says who may touch whom: two worlds, one family, two static bodies, a family that a mask names.
    # The two spheres of a body do not touch each other, also of one without a family and of a grain that is a body.
    at = [[0, 0, 0.01], [0, 0, 0.01], [1, 0, 0.01], [1, 0, 0.01], [2, 0, 0.01], [2, 0, 0.01], [3, 0, 0.01], [3, 0, 0.01], [4, 0, 0.01]]
    tags = [{"world": 1}, {"world": 2}, {"family": 40}, {"family": 40}, {"static": True}, {"static": True}, {"family": 5}, {"mask": 16}, {"family": 0}]
    report_of({**hung_pills, "bodies": [{"cluster": "pill", "position": p, **t} for p, t in zip(at, tags)],
               "settle": {**hung["settle"], "duration": 0.001, "grains": [
                   {"count": 2, "cluster": "pill", "low": [5, 0, 0], "high": [5.1, 0.1, 0.1]}]}}, "-o", "apart.npz")
    assert json.loads(run("detect", "apart_0000.npz", "--json").stdout)["contacts"] == 0
    # A bushing that is damped far above critically has a step at which it runs.
    for damping in (10, 300, 1e4):
        report_of({**hung_pills, "bodies": [{"cluster": "pill", "position": [x, 0, 1]} for x in (0, 0.05)],
                   "settle": {"bodies": [{"body": 0, "spin": [0, 5, 0]}], "duration": 0.001,
                              "bushings": [{"bodies": [0, 1], "at": [0.025, 0, 1], "stiffness": 5000, "damping": damping}]}})
    # A density is a mass for each cubed unit.
    refused_scene("write 7.8e-06", {**hung, "unit": "mm", "settle": {"material": {"density": 7800}}})
    assert report_of({**ball, "settle": {**ball["settle"], "duration": 1e300}}, "--steps", 3)["steps"] == 3
    refused("--frames", "pills.json", "--frames", 0, code=2)

    run("settle", "pills.json", "--steps", 20, "-o", "out.vtp")
    assert open("out_0000.vtp", "rb").read(20).startswith(b"<?xml")
    shown = report("pills.json", "-o", "pills.html", "--frames", 5)
    assert shown["frames"] == 5 and shown["page"] == {"spheres": 14, "bytes": os.path.getsize("pills.html")}, shown
    page = open("pills.html").read()
    check_frames(page, [f"same_{k:04}.npz" for k in range(report("pills.json", "-o", "same.npz", "--frames", 5)["frames"])])
    assert page.startswith("<!doctype html>") and "@HEAD@" not in page and "http" not in page.replace("https", "http").split("<script>")[0]

    # Scenes made by the program.
    run("settle", "--make", "silo", "--count", 400, "-o", "silo.json")
    from_file = report("silo.json", "--steps", 200)
    at_once = report("--make", "silo", "--count", 400, "-o", "silo.html", "--steps", 200)
    assert at_once["grains"] == 400 and at_once["state"] == from_file["state"] and os.path.exists("silo.html")
    refused("name with -o what to write", "--make", "silo", code=2)
    with unittest.mock.patch.dict(os.environ, OMPI_COMM_WORLD_RANK="0", OMPI_COMM_WORLD_SIZE="2"):  # by mpirun
        refused("without mpirun", "--make", "silo", code=2)
    refused("--cluster is for the ball and the track", "--make", "silo", "--cluster", "absent", "-o", "silo.json", code=2)
    no_utf8 = os.fsdecode(b"\xff.json")
    assert report("--make", "silo", "--count", 400, "-o", no_utf8)["count"] == 400
    assert report(no_utf8, "--steps", 1, "-o", os.fsdecode(b"\xff.npz"))["grains"] == 400
    if os.path.exists(os.path.join(BIN, "preview")):
        shown = run("preview", "silo.json", "-o", "silo.png", "--size", "64x32", "--samples", 1, "--json")
        assert json.loads(shown.stdout)["spheres"] == 400
    refused("at least 300 grains", "--make", "silo", "--count", 50, "-o", "silo.json")
    refused("name it with --cluster", "--make", "ball", "-o", "ball.json", code=2)
    refused("has no mass", "--make", "track", "--cluster", "pill.spheres.json", "-o", "track.json")

    # Grains that are bodies, and their levels of detail. One ball of radius 0.01, or two that are a tenth as wrong.
    proved = {"certified": True, "proved_against": "input"}
    ball = {**CLUSTER, "spheres": {"centers": [[0, 0, 0]], "radii": [0.01]}, "accuracy": {**proved, "protrusion_max": 0, "gap_max": 0}}
    ball["lods"] = [{"tolerance": 0.001, "accuracy": {**proved, "protrusion_max": 0.0009, "gap_max": 0},
                     "spheres": {"centers": [[0, 0, 0]], "radii": [0.0109]}}]
    write("ball.spheres.json", ball)
    box = {"low": [0, 0, 0], "high": [0.2, 0.2, 0.2]}
    made = {**SCENE, "clusters": {"ball": "ball.spheres.json"}, "settle": {
        "material": {"stiffness": 1e4}, "duration": 0.01, "planes": FLOOR,
        "grains": [{"count": 5, "radius": 0.02, "density": 1000, **box},
                   {"count": 7, "cluster": "ball", "low": [0, 0, 0.2], "high": [0.2, 0.2, 0.3], "velocity": [0, 0, -1]}]}}
    write("made.json", made)
    fine, auto, one = (report("made.json", "--lod", lod) for lod in ("0", "auto", "1"))
    assert (fine["bodies"], fine["grains"], fine["spheres"]) == (7, 5, 12), fine
    assert fine["fastest"] > 0.99 and fine["lod"] == {"spheres_finest": 7, "spheres": 7, "error": 0}, fine
    told = run("settle", "made.json", "--lod", 5).stderr
    assert told == "settle: warning: --lod 5: 7 bodies have no such level and take the coarsest that there is\n", told
    assert auto["lod"] == one["lod"] == {"spheres_finest": 7, "spheres": 7, "error": 0.0009} and auto["state"] == one["state"] != fine["state"]
    made["settle"]["grains"][0]["radius"] = 0.008  # now smaller than ten times the error
    assert report_of(made, "--lod", "auto")["lod"]["error"] == 0
    refused("level of detail", "made.json", "--lod", "coarse", code=2)
    made["settle"]["grains"][1]["cluster"] = "bill"
    refused_scene("no cluster of that name", made)
    two = {**SCENE, "clusters": {"ball": "ball.spheres.json"}, "bodies": [{"cluster": "ball", "position": [x, 0, 0]} for x in (0, 0.021, 1)]}
    write("two.json", two)
    found = json.loads(run("detect", "two.json", "--lod", "auto", "--json").stdout)
    assert found["contacts"] == 1 and found["lod"]["rungs"] == [1, 1, None] and found["lod"]["first_sphere"] == [0, 1, 2], found
    assert json.loads(run("detect", "two.json", "--json").stdout)["contacts"] == 0
    assert run("detect", "two.json", "--lod", 1).stderr == ""
    assert run("detect", "two.json", "--lod", 5).stderr.startswith("detect: warning: --lod 5: 3 bodies have no such level")
    assert run("detect", "two.json", "--lod", 5, "-q").stderr == ""

    # Materials: a grain on the floor slides on by what the two have between them.
    def slid(**pair):
        scene = scene_of(materials={"ice": {"density": 900}, "rubber": {"friction": 0.9}}, material_pairs=[{"of": ["ice", "rubber"], **pair}])
        scene["bodies"], scene["spheres"] = scene["bodies"][:1], []
        scene["settle"]["planes"][0]["material"] = "rubber"
        scene["settle"]["bodies"] = [{"body": 0, "velocity": [1, 0, 0], "material": "ice"}]
        return report_of(scene)["momentum"][0]
    assert slid(friction=0) > 1.5 * slid() >= 0, (slid(friction=0), slid())
    ice = json.load(open("scene.json"))
    ice["settle"]["bodies"][0]["material"] = "snow"
    refused_scene('no material "snow"', ice)
    ice["settle"]["bodies"][0]["material"] = "default"
    ice["settle"]["bodies"].append(ice["settle"]["bodies"][0])
    refused_scene("of the same body", ice)
    refused_scene("of the same two materials", scene_of(materials={"ice": {}}, material_pairs=[
        {"of": ["ice", "default"], "friction": 0.1}, {"of": ["default", "ice"], "friction": 0.9}]))
    refused_scene("two different bodies", scene_of(bushings=[{"bodies": [0, 0], "at": [0, 0, 0], "stiffness": 1}]))
    ice["settle"]["bodies"].pop()
    ice["settle"]["materials"] = {f"m{k}": {} for k in range(8)}
    refused_scene("at most 7 materials", ice)

    # No file that a run reads is overwritten by what it writes.
    run("settle", "ball.json", "--steps", 1, "-o", "again.npz")
    write("again.json", {**SCENE, "spheres": [{"file": "again_0000.npz"}], "settle": {"planes": FLOOR}})
    before = open("again_0000.npz", "rb").read()
    read = "is a file that this run reads"
    refused(read, "again.json", "-o", "again.npz", code=2)
    refused(read, "again.json", "--checkpoint", "again_0000.npz", code=2)
    report("again.json", "--checkpoint", "state_0000.npz", "--steps", 5)
    refused(read, "again.json", "--resume", "state_0000.npz", "-o", "state.npz", code=2)
    report("again.json", "--resume", "state_0000.npz", "--checkpoint", "state_0000.npz", "--steps", 5)
    refused(read, "--make", "ball", "--cluster", "ball.spheres.json", "-o", "./ball.spheres.json", code=2)
    os.symlink("again.json", "again.html")
    refused(read, "again.json", "-o", "again.html", code=2)
    assert open("again_0000.npz", "rb").read() == before

    refused("would both write", "again.json", "-o", "new.npz", "--checkpoint", "./new_0000.npz", code=2)
    assert report("ball.json", "--steps", 2, "-o", "few.npz", "--frames", 1000000)["frames"] == 3
    fewer = run("settle", "ball.json", "--steps", 2, "-o", "few.npz", "--frames", 2).stderr
    assert "few_0002.npz is no frame of this run and was there before: remove it" in fewer, fewer
    assert "frame" not in run("settle", "ball.json", "--steps", 2, "-o", "few.npz", "--frames", 3).stderr

    # - is stdin, and of a page stdout.
    with open("ball.json") as stdin:
        piped = subprocess.run([os.path.join(BIN, "settle"), "-", "--steps", "2", "-o", "-"], stdin=stdin, capture_output=True, text=True)
    assert piped.returncode == 0 and piped.stdout.startswith("<!doctype html>") and piped.stderr == "", piped.stderr
    refused("where --json prints", "ball.json", "-o", "-", "--json", code=2)

    # No option is passed over.
    refused("--seed is for --make", "ball.json", "--seed", 2, code=2)
    refused("--seed", "--make", "silo", "--seed", 2**63, "-o", "silo.json", code=2)
    run("settle", "--make", "silo", "--count", 300, "--seed", 2**63 - 1, "-o", "silo.json")
    report("silo.json", "--steps", 1)
    refused("--frames counts what -o writes", "ball.json", "--frames", 2, code=2)
    refused("--steps is for settling", "--make", "silo", "-o", "silo.json", "--steps", 2, code=2)
    refused("--frames", "ball.json", "-o", "few.npz", "--frames", 1000001, code=2)

    # What is wrong is said in one sentence.
    mass = {"volume": 1, "center": [0, 0, 0], "inertia": [[1, 0, 0], [0, 2, 0], [0, 0, 2]], "axes": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "moments": [1, 2, 2]}
    for name, value in (("axes", [[0, 0, 0]] * 3), ("axes", [[2, 0, 0], [0, 2, 0], [0, 0, 2]]), ("axes", [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]),
                        ("moments", [-1, 2, 2]), ("moments", [1, 2, 3])):
        write("heavy.spheres.json", {**CLUSTER, "mass_properties": {**mass, name: value}})
        refused_scene("cluster pill: no body has its mass_properties", {**scene_of(), "clusters": {"pill": "heavy.spheres.json"}})
    write("heavy.spheres.json", {**CLUSTER, "mass_properties": mass})
    report("scene.json", "--steps", 1)
    pills = scene_of(bodies=[{"body": 0, "velocity": [0, 0, 0.01], "driven": True}])
    pills["spheres"][0].update(family=[1, 2], mask=3)
    write("pills.json", pills)
    report("pills.json", "--steps", 1, "--checkpoint", "tags.npz")
    report("pills.json", "--steps", 1, "--resume", "tags.npz")
    for at, key, value in ((pills["spheres"][0], "family", 1), (pills["spheres"][0], "mask", 0), (pills["bodies"][0], "world", 1),
                           (pills["settle"]["bodies"][0], "driven", False)):
        before = at.get(key, 0)
        at[key] = value
        refused_scene("is of another scene", pills, "--resume", "tags.npz")
        at[key] = before
    def damaged(part, name, change):
        with zipfile.ZipFile("tags.npz") as good, zipfile.ZipFile("bad.npz", "w") as bad:
            for array in good.namelist():
                text = good.read(array)
                bad.writestr(array, change(text) if array == name else text)
        refused(part, "pills.json", "--resume", "bad.npz")
    for name in ("position.npy", "momentum.npy", "orientation.npy"):
        damaged("the checkpoint is damaged", name, lambda text: text[:-8] + struct.pack("<d", float("inf")))
    damaged("no rotation", "orientation.npy", lambda text: text[:-8] + struct.pack("<d", 2))
    damaged("number of steps", "steps.npy", lambda text: text[:-8] + struct.pack("<d", float("nan")))
    damaged("number of steps", "steps.npy", lambda text: text[:-16].replace(b"(1, 2, )", b"(0, 2, )"))
    pills["spheres"][0]["world"] = [0, 1]
    refused_scene("loose sphere 1 is in a world", pills)
    refused("at most 10^15", "pills.json", "--steps", 2**64 - 1, code=2)
    for motion in ({"driven": True}, {"velocity": [1, 0, 0]}, {"spin": [0, 0, 1]}):
        still = scene_of(bodies=[{"body": 0, **motion}])
        still["bodies"][0]["static"] = True
        refused_scene("is static and stands still", still)
    still["settle"]["bodies"][0]["spin"] = [0, 0, 0]
    report_of(still, "--steps", 1)
    write("mat.spheres.json", {**CLUSTER, "spheres": {"centers": [[0.01 * (k % 15), 0.01 * (k // 15), 0] for k in range(225)],
                                                      "radii": [0.01] * 225}})
    mat = {**SCENE, "clusters": {"mat": "mat.spheres.json"}, "bodies": [{"cluster": "mat", "position": [0, 0, 0.03]}], "settle": {"planes": FLOOR}}
    chosen = report_of(mat, "--until-rest")
    assert chosen["at_rest"], chosen
    mat["settle"]["time_step"] = 225 / 40 * chosen["time_step"]  # as if it lay on one sphere at a time
    write("mat.json", mat)
    told = run("settle", "mat.json", code=1).stderr
    assert math.isclose(float(re.search(r'use a "time_step" of less than (\S+)', told).group(1)), mat["settle"]["time_step"], rel_tol=1e-3), told
    refused_scene('bushings 0: "stiffness" is missing', scene_of(bushings=[{"bodies": [0, 1], "at": [0, 0, 0]}]))
    refused_scene('cylinder: "radius" is missing', scene_of(cylinder={"point": [0, 0, 0], "axis": [0, 0, 1]}))
    for density, size in ((1e-320, "small"), (1e308, "large")):
        one = {**SCENE, "spheres": [{"centers": [[0, 0, 2]], "radii": 1}], "settle": {"material": {"density": density}}}
        refused_scene(f"grain 0 has a mass or moment of inertia that is too {size}", one)
    refused_scene("is unstable for this stiffness", scene_of(time_step=1))
    refused_scene("grains find room", scene_of(grains=[{"count": 100, "radius": 0.01, "low": [0, 0, 0.1], "high": [0.05, 0.05, 0.13]}]))
    refused_scene("grains 0: its largest grain, of radius 3, does not fit into the cylinder of radius 2",
                  scene_of(cylinder={"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 2},
                           grains=[{"count": 1, "radius": 3, "low": [-9, -9, 0], "high": [9, 9, 9]}]))
    refused_scene("gravitiy", scene_of(gravitiy=[0, 0, -1]))
    refused_scene("is of another scene", scene_of(gravity=[0, 0, -1]), "--resume", "half.npz")
    refused_scene("at most 1e100", scene_of(gravity=[0, 0, -1e300]))
    deep = scene_of()
    deep["spheres"][0]["centers"] = [[0, 0, 0.05], [0, 0, 0.0501]]
    refused_scene("exploded in step 0 (time 0): grain 0 and grain 1 overlap by 0.0179, more than a radius", deep)
    deep["spheres"][0]["centers"] = [[0, 0, 0.5], [0, 0, -0.01]]
    refused_scene("grain 1 and plane 0 overlap by 0.019,", deep)
    deep["bodies"][3]["position"] = [0.03, 0.003, 0.03]
    deep["settle"]["planes"], deep["settle"]["cylinder"] = [], {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 0.5}
    refused_scene("body 1 and body 3 overlap by", deep)
    deep["bodies"][3]["position"] = [0.8, 0, 0.03]
    refused_scene("body 3 and the cylinder overlap by", deep)
    refused('"out_0002.npz" holds spheres alone: name it in a scene', "out_0002.npz", code=2)
    bare = scene_of()
    del bare["settle"]
    refused_scene("has no object \"settle\"", bare)
    refused("end it with", "pills.json", "-o", "out.csv", code=2)
    refused("checkpoint", "pills.json", "--resume", "out_0000.npz")
print("settle: scenes made, settled, resumed, shown and refused as promised")
