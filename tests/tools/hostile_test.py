#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Files and circumstances that want to break the programs: bombs, depth, links, names, permissions, full disks, closed pipes.

Each ends in a result or in one sentence, within 60 s and 4 GiB, and leaves no half-written file. Takes the programs' folder.
"""
import json
import os
import pathlib
import pwd
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import zipfile

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
CUBE = ("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n"
        "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n")
QUICK = ["--tolerance", "10%", "--effort", "0"]
GIB = 1 << 30
SANITIZERS = [name for name in (b"__asan_init", b"__tsan_init") if name in (BIN / "pad").read_bytes()]  # they reserve terabytes


MODEL_OF_3MF = ('<Relationships><Relationship Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
                "</Relationships>")


def robot(inside, before=""):
    return f'<?xml version="1.0"?>{before}<robot name="r"><link name="a">{inside}</link></robot>'


def scene(spheres=({"centers": [[0, 0, 1]], "radii": 1},), **more):
    return json.dumps({"format": "padder.scene", "version": 1, "spheres": spheres, **more})


class HostileTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="padder hostile ß ")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.put("cube.obj", CUBE)

    def put(self, name, content):
        data = content if isinstance(content, bytes) else content.encode()
        (self.folder / name).write_bytes(data)
        return name

    def files(self):
        return {str(f.relative_to(self.folder)) for f in self.folder.rglob("*") if f.is_file()}

    def tool(self, name, *words, **more):
        def limit():
            if not SANITIZERS:
                resource.setrlimit(resource.RLIMIT_AS, (4 * GIB,) * 2)
            more.pop("limit", lambda: None)()
        return subprocess.run([BIN / name, *map(str, words)], cwd=self.folder, capture_output=True, timeout=600 if SANITIZERS else 60,
                              stdin=subprocess.DEVNULL, preexec_fn=limit)

    def sentence(self, name, *words, says="", code=1, **more):
        done = self.tool(name, *words, **more)
        err = done.stderr.decode()
        self.assertEqual((done.returncode, done.stdout, err.count("\n")), (code, b"", 1), (words, err[:500]))
        self.assertTrue(err.startswith(name + ": "), err)
        self.assertNotIn("unexpected", err)
        self.assertLess(len(err), 1200)
        self.assertIn(says, err)
        return err

    def works(self, name, *words, **more):
        done = self.tool(name, *words, **more)
        self.assertEqual(done.returncode, 0, (words, done.stderr[:500]))
        return done

    def refused(self, cases, program="pad", *words):
        before = None
        for name, content in cases.items():
            with self.subTest(name):
                self.put(name, content)
                before = self.files()
                self.sentence(program, name, *words)
                self.assertEqual(self.files(), before)

    def test_deep_and_long_xml(self):
        deep = 200000
        entities = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">' + "".join(
            f'<!ENTITY {chr(98 + k)} "{10 * f"&{chr(97 + k)};"}">' for k in range(12)) + "]>"
        self.refused({
            "deep.urdf": robot("<x>" * deep + "</x>" * deep),
            "open.urdf": robot("<x>" * deep),
            "attributes.urdf": robot("<x " + " ".join(f'a{k}=""' for k in range(200000)) + "/>"),
            "entities.urdf": robot('<collision><geometry><box size="&m;"/></geometry></collision>', entities),
            "outside.urdf": robot('<collision><geometry><box size="&x;"/></geometry></collision>', '<!DOCTYPE r [<!ENTITY x SYSTEM "/etc/passwd">]>'),
            "deep.dae": '<?xml version="1.0"?><COLLADA version="1.4.1">' + "<a>" * deep + "</a>" * deep + "</COLLADA>",
            "entities.dae": '<?xml version="1.0"?>' + entities + '<COLLADA version="1.4.1">&m;</COLLADA>',
        }, "pad", *QUICK)

    @unittest.skipIf(SANITIZERS, "a sanitizer needs terabytes of addresses")
    def test_nodes_that_multiply_one_another(self):
        triangle = '<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="f" count="9">0 0 0 1 0 0 0 1 0</float_array>' \
                   '<technique_common><accessor source="#f" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>' \
                   '<param name="Z" type="float"/></accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/>' \
                   '</vertices><triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>'

        def nodes(levels):
            inner = "".join(f'<node id="n{k}">' + f'<instance_node url="#n{k + 1}"/>' * 10 + "</node>" for k in range(levels))
            return f'<?xml version="1.0"?><COLLADA version="1.4.1">{triangle}<library_nodes>{inner}<node id="n{levels}"><instance_geometry url="#g"/></node>' \
                   '</library_nodes><library_visual_scenes><visual_scene id="s"><node id="r"><instance_node url="#n0"/></node></visual_scene>' \
                   '</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>'
        self.put("ten.dae", nodes(1))
        self.works("pad", "ten.dae", "-q", *QUICK)
        self.put("bomb.dae", nodes(9)), self.put("itself.dae", nodes(2).replace("#n2", "#n0"))
        self.sentence("pad", "bomb.dae", "--memory", "150M", says="memory")
        self.sentence("pad", "itself.dae", says="damaged")

    def test_deep_and_long_yaml(self):
        sphere = "{center: [0, 0, 0], radius: 1}"
        aliases = f"a0: &a0 {sphere}\n" + "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]\n" for k in range(1, 10))
        self.refused({"deep.yaml": "collision_spheres: " + "[" * 200000, "aliases.yaml": aliases + "collision_spheres: {l: *a9}",
                      "itself.yaml": "collision_spheres: &a {l: *a}", "open.xrdf": "geometry: " + "{a: " * 200000,
                      "indented.yaml": "collision_spheres:\n" + "".join(" " * k + "a:\n" for k in range(1, 3000))}, "pad", "-o", "a.npz")

    def test_deep_and_long_json(self):
        deep = 10**6
        cluster = '{"format": "padder.cluster", "version": 1, "spheres": {"centers": %s, "radii": [1]}}'
        self.refused({"deep.spheres.json": cluster % ("[" * deep + "]" * deep), "open.spheres.json": cluster % ("[" * deep),
                      "keys.spheres.json": "{" + ",".join(f'"{k}": 0' for k in range(300000)) + "}",
                      "number.spheres.json": cluster % ("[[" + "1" * 10**6 + ", 0, 0]]"),
                      "deep.json": '{"format": "padder.scene", "version": 1, "bodies": ' + "[" * deep + "]" * deep + "}"}, "detect")
        self.refused({"deep.gltf": '{"asset": {"version": "2.0"}, "x": ' + '{"a":' * deep + "1" + "}" * deep + "}",
                      "deep2.gltf": "[" * deep + "]" * deep}, "pad")

    def test_counts_that_the_file_does_not_hold(self):
        header = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n" \
                 "property list uchar int vertex_indices\nend_header\n"
        stl = b"\0" * 80 + struct.pack("<I", 0xffffffff) + b"\0" * 50
        self.refused({"many.ply": header.format("binary_little_endian", 2**62, 1), "faces.ply": header.format("ascii", 3, 2**63) + "0 0 0\n" * 3,
                      "negative.ply": header.format("ascii", -1, 1), "many.off": "OFF\n4000000000 1 0\n0 0 0\n", "many2.off": f"OFF\n{2**64} 1 0\n",
                      "many.stl": stl, "index.obj": CUBE + "f 1 2 99999999999999999999\n", "index2.obj": CUBE + "f 1 2 -4294967297\n",
                      "nan.obj": CUBE.replace("v 1 1 1", "v nan inf 1e999"), "nul.obj": b"\0" * 10**6, "text.stl": b"solid" + b" " * 10**6,
                      "line.obj": "f" + " 1" * 10**6 + "\n"}, "pad", *QUICK)

    def scene_of(self, file):
        return self.put("scene.json", scene([{"file": file}]))

    def test_ends_too_far_apart_and_no_xacro(self):
        for ends in ("0 0 0 1e300 1e300 0", "-1e308 0 0 1e308 0 0"):
            self.put("m.xml", f'<mujoco><worldbody><body><geom type="capsule" size="1" fromto="{ends}"/></body></worldbody></mujoco>')
            self.sentence("pad", "m.xml", *QUICK, "-o", "out.urdf", says="too far apart")
        self.put("r.xacro", robot(""))
        self.sentence("pad", "r.xacro", *QUICK, says="the program xacro", limit=lambda: os.environ.update(PATH="/bin"))

    def test_numbers_that_could_be_octal_or_hexadecimal(self):
        for text in ("010", "0x10"):
            for words in (["track_shoe", "--lugs"], ["grain", "--planes"], ["hopper", "--bolts"], ["road_wheel", "--segments"],
                          ["grain", "--seed"]):
                self.sentence("make_assets", *words, text, code=2, says=f'"{text}" is no whole number in decimal digits')
            for option in ("--max-spheres", "--effort", "--family", "--robot-spheres", "--self-collision", "--workers", "--threads"):
                self.sentence("pad", "absent.obj", option, text, code=2, says=f'"{text}" is no whole number in decimal digits')
        self.assertEqual(self.files(), {"cube.obj"})

    def test_more_threads_than_a_stack_holds(self):
        self.put("a.obj", CUBE)
        self.works("pad", "a.obj", *QUICK, limit=lambda: os.environ.update(OMP_NUM_THREADS="100000", OMP_STACKSIZE="64K"))

    def test_boxes_of_grains_without_end(self):
        def silo(low, high):
            return scene([], settle={
                "material": {"density": 2500}, "duration": 1, "planes": [{"point": [0, 0, 0], "normal": [0, 0, 1]}],
                "cylinder": {"point": [0, 0, 0], "axis": [0, 0, 1], "radius": 0.1}, "grains": [{"count": 300, "radius": 0.01, "low": low, "high": high}]})
        self.refused({"wide.json": silo([-0.1, -0.1, 0], [0.1, 1e9, 3]), "wider.json": silo([-1e300, -1e300, 0], [1e300, 1e300, 1e300]),
                      "flat.json": silo([0, 0, 0], [0, 1e9, 1e9])}, "settle", "--steps", "1", "-o", "a.npz")
        self.put("many.json", silo([-1, -1, 0], [1, 1, 1e9]).replace('"count": 300', '"count": 4000000000').replace("0.01", "1e-9"))
        self.sentence("settle", "many.json", "--steps", "1", says="grains 0, count: so many grains take more memory than this machine has")

    def test_archives_that_unpack_to_gigabytes(self):
        def archive(name, part, size, **more):
            with zipfile.ZipFile(self.folder / name, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as z:
                for other, text in more.items():
                    z.writestr(other, text)
                with z.open(part, "w", force_zip64=True) as f:
                    for _ in range(size >> 24):
                        f.write(bytes(1 << 24))
        archive("bomb.3mf", "3D/3dmodel.model", 3 * GIB >> 1, **{"_rels/.rels": MODEL_OF_3MF})
        self.sentence("pad", "bomb.3mf", says="at most")
        archive("bomb.npz", "centers.npy", GIB >> 2)
        self.sentence("detect", self.scene_of("bomb.npz"), says="bomb.npz")

    def test_sparse_files(self):
        for name in ("a.obj", "a.stl", "a.3mf", "a.spheres.json", "a.npz"):
            with self.subTest(name):
                os.truncate(self.put(name, "") and self.folder / name, 20 * GIB)
                if name == "a.npz":
                    self.sentence("detect", self.scene_of(name), says=name)
                else:
                    self.sentence("detect" if "s.json" in name else "pad", name)
                os.unlink(self.folder / name)

    def test_links_and_pipes_and_devices(self):
        os.symlink("loop.obj", self.folder / "loop.obj")
        os.symlink("absent.obj", self.folder / "dangling.obj")
        os.symlink("/dev/zero", self.folder / "zero.obj")
        os.mkfifo(self.folder / "pipe.obj")
        os.mkdir(self.folder / "folder.obj")
        for name in ("loop.obj", "dangling.obj", "zero.obj", "pipe.obj"):
            self.sentence("pad", name, says=name)
        os.symlink("cube.obj", self.folder / "link.obj")
        self.works("pad", "link.obj", "-q", *QUICK)
        # Under a link the file that it leads to is written, also where there is none yet.
        os.mkdir(self.folder / "far")
        os.symlink("far/asset", self.folder / "cube.spheres.json")
        for _ in range(2):
            self.works("pad", "cube.obj", "-q", *QUICK)
            self.assertTrue((self.folder / "cube.spheres.json").is_symlink())
            self.assertIn('"padder.cluster"', (self.folder / "far/asset").read_text())
            self.assertEqual(os.listdir(self.folder / "far"), ["asset"])
        os.symlink("cube.obj", self.folder / "input.obj")
        self.sentence("pad", "cube.obj", *QUICK, "--write-mesh", "input.obj", code=2, says="input.obj is a file that this run reads")
        self.sentence("pad", "cube.obj", *QUICK, "--write-mesh", "loop.obj", says="loop.obj: Too many levels of symbolic links")
        self.sentence("pad", "", says="MESH is empty: name a file", code=2)
        # A list of parts passes over them; folders behind links are not entered, so no circle has an end.
        os.mkdir(self.folder / "parts")
        os.symlink("..", self.folder / "parts/up")
        shutil.copy(self.folder / "cube.obj", self.folder / "parts")
        os.mkfifo(self.folder / "parts/pipe.obj")
        self.assertIn(b"1 part: 1 made", self.works("pad", "parts", "-o", "out", *QUICK).stdout)

    def test_scenes_and_gltf_name_files_that_are_none(self):
        os.mkfifo(self.folder / "pipe")
        for name in ("pipe", "/dev/zero", "/proc/self/mem", "absent", "."):
            buffers = [{"uri": name, "byteLength": 36}]
            self.put("a.gltf", json.dumps({"asset": {"version": "2.0"}, "buffers": buffers, "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
                                           "bufferViews": [{"buffer": 0, "byteLength": 36}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0,
                                           "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}]}))
            self.sentence("pad", "a.gltf")
            self.put("a.json", scene([], clusters={"a": name}, bodies=[{"cluster": "a", "position": [0, 0, 0]}]))
            self.sentence("detect", "a.json")
            self.put("a.urdf", robot(f'<collision><geometry><mesh filename="{name}"/></geometry></collision>'))
            self.sentence("pad", "a.urdf")

    def test_names_of_every_kind(self):
        for name in ("with blank.obj", "ünïcödé 部品.obj", "-dash.obj", "new\nline.obj", "quote'\".obj", "%s%n.obj", "a" * 200 + ".obj", ".hidden.obj"):
            with self.subTest(name):
                self.put(name, CUBE)
                self.works("pad", "./" + name, "-q", *QUICK)
                self.assertIn(name[:-4] + ".spheres.json", self.files())
                self.works("pad", "./" + name, "--json", *QUICK)
                self.sentence("pad", "./absent " + name)
        raw = os.fsencode(self.folder) + b"/\xff\xfe.obj"  # no UTF-8
        with open(raw, "w") as f:
            f.write(CUBE)
        done = subprocess.run([BIN / "pad", raw, "--json", *QUICK, "-o", self.folder / "raw.spheres.json"], capture_output=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        json.loads(done.stdout)
        self.sentence("pad", "a" * 300 + ".obj")
        for words in (["-o", "a" * 300], ["--preview", "a" * 300], ["--unit", "new\nline"]):
            self.sentence("pad", "cube.obj", *QUICK, *words, code=2 if "--unit" in words else 1)

    def as_nobody(self):
        """Root may write everywhere."""
        if os.geteuid() != 0:
            return lambda: None
        os.chmod(self.folder, 0o777)
        return lambda: (os.setgroups([]), os.setuid(pwd.getpwnam("nobody").pw_uid))

    def test_what_may_not_be_read_or_written(self):
        drop = self.as_nobody()
        self.put("secret.obj", CUBE)
        os.chmod(self.folder / "secret.obj", 0)
        os.mkdir(self.folder / "closed", 0o555), os.mkdir(self.folder / "hidden", 0o000)
        os.chmod(self.folder / "closed", 0o555), os.chmod(self.folder / "hidden", 0o000)
        try:
            self.sentence("pad", "secret.obj", says="secret.obj", limit=drop)
            self.sentence("pad", "cube.obj", "-o", "closed/a.spheres.json", *QUICK, says="closed/a.spheres.json", limit=drop)
            self.sentence("pad", "cube.obj", "-o", "closed/a/", *QUICK, says="closed", limit=drop)
            self.sentence("pad", "hidden", "-o", "out", *QUICK, says="hidden", limit=drop)
            os.mkdir(self.folder / "parts"), shutil.copy(self.folder / "cube.obj", self.folder / "parts")
            self.sentence("pad", "parts", "-o", "closed", *QUICK, says="closed", limit=drop)
        finally:
            os.chmod(self.folder / "hidden", 0o755)
        self.assertEqual(self.files(), {"cube.obj", "secret.obj", "parts/cube.obj"})

    @unittest.skipIf(b"__tsan_init" in SANITIZERS, "the thread sanitizer writes files of its own when it begins")
    def test_a_limit_of_file_sizes_leaves_nothing(self):
        for ending in (".spheres.json", ".npz", ".vtp", ".glb", ".yaml"):
            self.put("a" + ending, "old")
            self.sentence("pad", "cube.obj", "-o", "a" + ending, "--tolerance", "2%", "--effort", "0",
                          limit=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1200, 1200)))  # libomp itself writes 1 KiB
            self.assertEqual((self.folder / ("a" + ending)).read_text(), "old")
            (self.folder / ("a" + ending)).unlink()
            self.assertEqual(self.files(), {"cube.obj"})
        for words in (["new/folder/"], ["new/a.spheres.json"], ["new/a.vtp"]):
            self.sentence("pad", "cube.obj", "-o", *words, "--tolerance", "2%", "--effort", "0",
                          limit=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1200, 1200)))
            self.assertEqual(os.listdir(self.folder), ["cube.obj"], "no empty folder stays")

    @unittest.skipIf(SANITIZERS, "a sanitizer needs terabytes of addresses")
    def test_a_limit_of_memory_leaves_a_sentence_or_an_asset(self):
        """Wherever memory runs out, there is one line on stderr and no half asset."""
        for megabytes in (32, 40, 48, 56, 64, 80, 96):
            most = megabytes << 20
            done = self.tool("pad", "cube.obj", "--tolerance", "0.5%", "--effort", "0", "--threads", "2", "-q",
                             limit=lambda: resource.setrlimit(resource.RLIMIT_DATA, (most, most)))
            with self.subTest(megabytes):
                self.assertIn(done.returncode, (0, 1), done.stderr)
                self.assertEqual(done.stderr.count(b"\n"), done.returncode, done.stderr)
                self.assertEqual("cube.spheres.json" in self.files(), done.returncode == 0)
            (self.folder / "cube.spheres.json").unlink(missing_ok=True)

    @unittest.skipIf(SANITIZERS, "a sanitizer needs terabytes of addresses")
    def test_one_file_has_limits_too(self):
        """--memory and --seconds without a manifest: a sentence, nothing half-written, and no more memory than was given."""
        heavy = ["cube.obj", "--depth", "0.1", "--edge-length", "0.1%", "--threads", "1"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        err = self.sentence("pad", *heavy, "--memory", "100M", says="--memory")
        self.assertIn("not enough memory", err)
        self.assertLess(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, max(before, 200 << 10))
        begin = time.monotonic()
        self.sentence("pad", *heavy, "--seconds", "0.5", says="--seconds")
        self.assertLess(time.monotonic() - begin, 30)
        done = self.tool("pad", *heavy, "--seconds", "0.5", "--json")
        self.assertEqual(done.returncode, 1)
        self.assertIn("--seconds", json.loads(done.stdout)["error"])
        self.assertEqual(self.files(), {"cube.obj"})
        self.works("pad", "cube.obj", "-q", *QUICK, "--memory", "1G", "--seconds", "60")

    def test_no_folder_for_temporary_files(self):
        self.sentence("pad", "cube.obj", "-o", "-", *QUICK, says="TMPDIR", limit=lambda: os.putenv("TMPDIR", "/nonexistent"))

    def run_to_nobody(self, name, *words, **more):
        """Into a pipe whose reader has ended."""
        read, write = os.pipe()
        os.close(read)
        done = subprocess.run([BIN / name, *words], cwd=self.folder, stdout=write, stderr=subprocess.PIPE, **more)
        os.close(write)
        return done

    def test_pipes_that_close_early(self):
        for words in (["cube.obj", "--json"], ["--help"]):
            done = self.run_to_nobody("pad", *words, *(QUICK if words[0] != "--help" else []))
            # Ended by the signal, as a shell's pipes expect, or with a sentence: Python ignores SIGPIPE for its children unless told otherwise.
            self.assertIn(done.returncode, (-signal.SIGPIPE, 1), done.stderr)
            self.assertLessEqual(done.stderr.count(b"\n"), 1)
        self.assertEqual(self.files(), {"cube.obj", "cube.spheres.json"})
        with open("/dev/full", "w") as full:
            done = subprocess.run([BIN / "pad", "cube.obj", "--json", *QUICK], cwd=self.folder, stdout=full, stderr=subprocess.PIPE)
        self.assertEqual((done.returncode, done.stderr.count(b"\n")), (1, 1))

    def test_a_bench_that_is_ended_leaves_no_process(self):
        if not (BIN / "bench").exists():
            self.skipTest("bench is not built")
        bench = subprocess.Popen([BIN / "bench", "hard", "--scene", "million", "-q"], stdout=subprocess.DEVNULL)
        children, patience = [], time.monotonic() + 60
        while not children and time.monotonic() < patience:
            children = pathlib.Path(f"/proc/{bench.pid}/task/{bench.pid}/children").read_text().split()
        bench.terminate()
        self.assertEqual((bench.wait(), len(children)), (128 + signal.SIGTERM, 1))

        def runs(child):
            try:
                return pathlib.Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
            except OSError:
                return False
        patience = time.monotonic() + 3  # the mesh takes longer
        while runs(children[0]) and time.monotonic() < patience:
            time.sleep(0.01)
        self.assertFalse(runs(children[0]))

    def test_standard_streams_that_are_closed(self):
        self.put("list", "cube.obj\n")
        for words in (["cube.obj"], ["--manifest", "list", "-o", "out"], ["cube.obj", "-o", "-"]):
            for closed in ((0,), (1,), (2,), (0, 1), (0, 1, 2)):
                with self.subTest(words=words, closed=closed):
                    done = self.tool("pad", *words, *QUICK, limit=lambda: [os.close(stream) for stream in closed])
                    self.assertEqual(done.returncode, 1 if 1 in closed else 0, done.stderr)  # it cannot print what it has done
                    if 1 in closed and 2 not in closed:
                        self.assertIn(b"cannot write to the standard output", done.stderr)
                    for made in (f for f in self.files() if f.endswith(".spheres.json")):
                        json.loads((self.folder / made).read_text())
                    self.assertFalse([f for f in self.files() if ".part" in f])
        for made in ("cube.spheres.json", "out/cube.spheres.json"):
            self.assertIn(made, self.files())

    def test_a_reader_that_ends_leaves_no_temporary_file(self):
        self.works("pad", "cube.obj", "-q", *QUICK)
        temporary = self.folder / "tmp"
        os.mkdir(temporary)
        for words in (["pad", "cube.obj", "-o", "-", *QUICK], ["detect", "cube.spheres.json", "--copies", "9", "-o", "-", "--format", "csv"],
                      ["preview", "cube.spheres.json", "-o", "-", "--format", "png", "--size", "64x64", "--samples", "1"]):
            if not (BIN / words[0]).exists():
                continue
            done = self.run_to_nobody(*words, env={**os.environ, "TMPDIR": str(temporary)})
            self.assertEqual((done.returncode, done.stderr), (-signal.SIGPIPE, b""), words)
            self.assertEqual(os.listdir(temporary), [], words)

    def test_content_of_a_robot_that_would_be_lost(self):
        box = '<geometry><box size="1 1 1"/></geometry>'
        solid = f"<collision>{box}</collision>"
        heavy = '<inertial><mass value="{}"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'

        def joint(inside):
            return f'<robot name="r"><link name="a">{solid}</link><link name="b">{solid}</link><link name="c">{solid}</link>' \
                   f'<joint name="j" type="fixed">{inside}</joint><joint name="k" type="fixed"><parent link="a"/><child link="c"/></joint></robot>'
        ends = '<parent link="a"/><child link="b"/>'
        for what, text, says in (
                ("geometries", robot(f'<collision>{box}<geometry><sphere radius="5"/></geometry></collision>'), "more than one <geometry>"),
                ("boxes", robot('<collision><geometry><box size="1 1 1"/><box size="9 9 9"/></geometry></collision>'), "more than one <box>"),
                ("shapes", robot('<collision><geometry><box size="1 1 1"/><sphere radius="9"/></geometry></collision>'), "more than one shape"),
                ("origins", robot(f'<collision><origin/><origin xyz="1 0 0"/>{box}</collision>'), "more than one <origin>"),
                ("negative", robot(solid + heavy.format(-1)), "mass is below 0"),
                ("parents", joint(ends + '<parent link="c"/>'), "more than one <parent>"),
                ("places", joint(ends + '<origin/><origin xyz="1 0 0"/>'), "more than one <origin>"),
                ("robots", robot(solid) + robot(solid).split("?>")[1], "a second root element, <robot>"),
                ("text", robot(solid) + "left over", "text outside of the root element: 'left over'"),
                ("entity", robot(solid, '<!DOCTYPE r [<!ENTITY a "b">]>'), "entities (<!ENTITY) are not read"),
                ("bytes", robot(solid).encode().replace(b'"a"', b'"a\xff\xfe"'), "not UTF-8"),
                ("glued", robot('<collision><geometry><box size="1.5.5 1"/></geometry></collision>'), 'size wants three numbers, not "1.5.5 1"'),
                ("dashed", robot(f'<collision><origin xyz="1-2-3"/>{box}</collision>'), 'xyz wants three numbers, not "1-2-3"')):
            with self.subTest(what):
                self.put("r.urdf", text)
                self.sentence("pad", "r.urdf", *QUICK, says=says)
        self.put("r.urdf", robot(f'<collision>{box.replace("1 1 1", " +1 1e0 1. ")}</collision>', "<!DOCTYPE r><!-- fine -->"))
        self.works("pad", "r.urdf", *QUICK, "-q")
        # Robots that are in use say the same twice, or have two <inertial>: a note tells which counts.
        self.put("two.urdf", robot(f'<collision><origin xyz="1 0 0"/><origin xyz="1 0 0"/>{box}</collision>' + heavy.format(1) + heavy.format(2)))
        self.assertIn(b"a: it has more than one <inertial>, of which the first counts", self.works("pad", "two.urdf", *QUICK).stdout)
        self.put("latin.urdf", robot(solid).replace("?>", ' encoding="ISO-8859-1"?>').encode().replace(b'"a"', b'"\xe4"'))
        self.works("pad", "latin.urdf", *QUICK, "-q")
        for inside, says in (('<body quat="1 0 0 0" euler="9 9 9"><geom size="1"/></body>', "it has quat and euler"),
                             ('<body euler="9 9 9" zaxis="0 0 1"><geom size="1"/></body>', "it has euler and zaxis"),
                             ('<body pos="0.1.2 3"><geom size="1"/></body>', 'pos takes 3 numbers, not "0.1.2 3"'),
                             ('<body><geom type="box" size="1 1 1 junk"/></body>', 'size takes 1 to 3 numbers, not "1 1 1 junk"'),
                             ('<body><inertial pos="0 0 0" mass="-1"/><geom type="box" size="1 1 1"/></body>', "mass is below 0")):
            with self.subTest(inside):
                self.put("m.xml", f"<mujoco><worldbody>{inside}</worldbody></mujoco>")
                self.sentence("pad", "m.xml", *QUICK, "-o", "out.urdf", says=says)

    def test_a_manifest_may_not_name_what_pad_keeps(self):
        for output, words, says in ((".pad/1-of-1.jsonl", [], "(.pad)"), ("./.pad/x", [], "(.pad)"), ("index.html", ["--page"], "(index.html)"),
                                    (".", [], "no file below"), ("a/..", [], "no file below")):
            with self.subTest(output):
                self.put("list", f"cube.obj --format vtp -o {output}\n")
                self.sentence("pad", "--manifest", "list", "-o", "out", *QUICK, *words, says=says, code=2)
        self.assertEqual(self.files(), {"cube.obj", "list"})

    def test_streams_without_end(self):
        with open("/dev/zero") as zero:
            done = subprocess.run([BIN / "pad", "--manifest", "-", "-o", "out"], cwd=self.folder, stdin=zero, capture_output=True, timeout=60,
                                  preexec_fn=lambda: SANITIZERS or resource.setrlimit(resource.RLIMIT_AS, (4 * GIB,) * 2))
        self.assertEqual((done.returncode, done.stderr.count(b"\n")), (1, 1))
        self.assertIn(b"the standard input is longer than 1024 MiB", done.stderr)

        def program(script):
            self.put("xacro", "#!/bin/sh\n" + script)
            os.chmod(self.folder / "xacro", 0o755)
        path = {"limit": lambda: os.environ.update(PATH=f"{self.folder}:{os.environ['PATH']}")}
        self.put("-o.xacro", "")
        program("exec yes")
        self.sentence("pad", "--", "-o.xacro", *[], says="xacro makes more than 256 MiB", **path)
        program(f'[ "$1" = ./-o.xacro ] && cat <<X\n{robot("<collision><geometry><box size=" + chr(34) + "1 1 1" + chr(34) + "/></geometry></collision>")}\nX\n')
        self.works("pad", *QUICK, "--", "-o.xacro", **path)
        program("exit 3")
        self.sentence("pad", "--", "-o.xacro", says="xacro cannot expand it", **path)
        # It ends with its parent.
        program("echo $$ > number; exec sleep 60")
        run = subprocess.Popen([BIN / "pad", "--", "-o.xacro"], cwd=self.folder, env={**os.environ, "PATH": f"{self.folder}:{os.environ['PATH']}"})
        number = self.folder / "number"
        while not number.exists() or not number.read_text().strip():
            time.sleep(0.01)
        run.kill(), run.wait()
        state = pathlib.Path(f"/proc/{number.read_text().strip()}/stat")
        for _ in range(500):
            if not state.exists() or state.read_text().split()[2] == "Z":
                break
            time.sleep(0.01)
        else:
            self.fail("xacro runs on without pad")

    def test_a_sparse_archive_is_searched_at_its_end(self):
        self.put("a.npz", "")
        os.truncate(self.folder / "a.npz", 200 * GIB)
        begin = time.monotonic()
        done = subprocess.run([BIN / "detect", "a.npz", "--memory", "1G"], cwd=self.folder, capture_output=True, timeout=60)
        self.assertEqual(done.returncode, 1)
        self.assertIn(b"no zip archive", done.stderr)
        self.assertLess(time.monotonic() - begin, 10)

    def test_components_that_multiply_one_another(self):
        triangle = '<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/></vertices>{}</mesh>'
        for name, mesh, says in (("nothing", "", ""), ("vertices", triangle.format(""), "points"),
                                 ("triangles", triangle.format('<triangles><triangle v1="0" v2="1" v3="2"/></triangles>'), "triangles")):
            objects = f'<object id="0">{mesh}</object>' + "".join(
                f'<object id="{k}"><components>' + f'<component objectid="{k - 1}"/>' * 10 + "</components></object>" for k in range(1, 13))
            with zipfile.ZipFile(self.folder / "a.3mf", "w") as z:
                z.writestr("_rels/.rels", MODEL_OF_3MF)
                z.writestr("3D/3dmodel.model", f'<model><resources>{objects}</resources><build><item objectid="12"/></build></model>')
            begin = time.monotonic()
            self.sentence("pad", "a.3mf", says=says)
            self.assertLess(time.monotonic() - begin, 10, name)

    def test_names_of_parts_are_shown_and_kept(self):
        os.mkdir(self.folder / "parts")
        self.put("parts/red\x1b[31m.obj", "junk")
        done = self.tool("pad", "parts", "-o", "out", *QUICK)
        self.assertEqual(done.returncode, 1)
        self.assertNotIn(b"\x1b", done.stderr + done.stdout)
        self.assertIn(b"red\\x1b[31m.obj", done.stderr)
        (self.folder / "parts/red\x1b[31m.obj").unlink()
        for name in (b"a\xff.obj", b"a\xfe.obj"):
            with open(os.fsencode(self.folder) + b"/parts/" + name, "w") as f:
                f.write(CUBE)
        self.assertIn(b"2 made, 0 were up to date", self.works("pad", "parts", "-o", "out", *QUICK).stdout)
        self.assertIn(b"0 made, 2 were up to date", self.works("pad", "parts", "-o", "out", *QUICK).stdout)

    def test_what_cannot_be_written_is_said_before_the_work(self):
        drop = self.as_nobody()
        self.works("pad", "cube.obj", "-q", *QUICK)
        self.put("long.json", scene(settle={"time_step": 1e-6, "duration": 1e6}))
        os.mkdir(self.folder / "closed"), os.chmod(self.folder / "closed", 0o555)
        heavy = ["pad", "cube.obj", "--depth", "0.1", "--edge-length", "0.1%"]
        for words in (["settle", "long.json", "-o", "{}/a.npz"], ["settle", "long.json", "-o", "{}/a.html"], ["settle", "long.json", "--checkpoint", "{}/a.npz"],
                      ["detect", "cube.spheres.json", "--copies", "200000", "-o", "{}/a.csv"], [*heavy, "-o", "{}/a.spheres.json"],
                      [*heavy, "--preview", "{}/a.png"], [*heavy, "--write-mesh", "{}/a.obj"]):
            for folder in ("closed", *(() if words[0] == "pad" else ("absent",)), "cube.obj"):
                with self.subTest(words=words, folder=folder):
                    begin = time.monotonic()
                    self.sentence(*[word.format(folder) for word in words], says=f"cannot write {folder}/a", limit=drop)
                    self.assertLess(time.monotonic() - begin, 10)
        for name in ("bad.urdf", "bad.obj"):
            self.put(name, robot('<collision><geometry><box size="1 1"/></geometry></collision>'))
            self.sentence("pad", name, "-o", "fresh/", *QUICK)
            self.assertFalse((self.folder / "fresh").exists())

    def test_options_that_would_do_nothing(self):
        self.works("pad", "cube.obj", "-q", *QUICK)
        self.put("seed.json", scene(settle={"seed": -1})), self.put("s.json", scene())
        if (BIN / "settle").exists():
            self.sentence("settle", "seed.json", "--steps", "1", says="seed")
        if not (BIN / "preview").exists():
            return
        for words in (["--samples", "2"], ["--size", "64x64"], ["--show", "spheres"], ["--plain"], ["--dark"]):
            self.sentence("preview", "cube.spheres.json", "-o", "a.html", *words, code=2, says=words[0] + " is for a picture")
        self.sentence("preview", "s.json", "-o", "a.png", "--show", "mesh", says="has no mesh to show")
        self.assertFalse([f for f in self.files() if f.startswith("a.")])

    def test_wrong_usage_and_what_to_do(self):
        for part, option, value in (("grain", "--planes", "0"), ("track_shoe", "--lugs", "26"), ("hopper", "--bolts", "21"), ("road_wheel", "--segments", "0")):
            err = self.sentence("make_assets", part, option, value, code=2)
            self.assertTrue(option in err and value in err, err)
        self.sentence("make_assets", "hopper", "--segments", "20", code=2, says="hopper: ")
        self.sentence("detect", "absent.npy", "--copies", "2", code=2, says="--copies")
        self.sentence("detect", "absent.npy", says="there is no such file")
        long = "a" * 300
        self.sentence("pad", "cube.obj", "-o", long + ".vtp", *QUICK, says="shorter name")
        os.symlink("loop.npz", self.folder / "loop.npz")
        self.sentence("detect", "loop.npz", says="check the name")
        if not (BIN / "settle").exists():
            return
        self.sentence("settle", "--make", "ball", "--count", "10", "-o", "b.html", code=2, says="--cluster")
        self.works("pad", "cube.obj", "-q", *QUICK)
        self.sentence("settle", "cube.spheres.json", says="it is a cluster")
        self.put("stiff.json", scene(settle={"material": {"stiffness": 1e308}}))
        self.sentence("settle", "stiff.json", "--steps", "1", says="at most 1e100")

    def test_a_kill_while_writing_leaves_no_half_asset(self):
        """As soon as something is written: under the final name there is the old file, or the new one as a whole."""
        words = [BIN / "pad", "cube.obj", "-q", "--depth", "0.5", "--edge-length", "4%", "--repair", "never"]
        subprocess.run(words, cwd=self.folder, check=True)
        asset = self.folder / "cube.spheres.json"
        whole = asset.read_bytes()
        for k in range(12):
            asset.write_text("old")
            run = subprocess.Popen(words, cwd=self.folder)
            while run.poll() is None and len(os.listdir(self.folder)) == 2 and asset.stat().st_size == 3:
                pass
            time.sleep(0.0002 * (k // 2))
            run.send_signal(signal.SIGKILL if k % 2 else signal.SIGINT)
            run.wait()
            self.assertIn(asset.read_bytes(), (b"old", whole))
            if k % 2 == 0:
                self.assertFalse(list(self.folder.glob("*.part*")))
            for half in self.folder.glob("*.part*"):
                half.unlink()


if __name__ == "__main__":
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    unittest.main()
