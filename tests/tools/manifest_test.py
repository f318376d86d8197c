#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""pad --manifest from outside: what is made, what is made again, and what a crash, a signal or a full disk leaves behind.

  manifest_test.py BIN                                    the tests
  manifest_test.py BIN --trial 20000 [--seed S]           the trial alone, with so many parts: 8 shards, two of them killed
                                                          and started again, one on a disk that fills up (needs root)
"""
import argparse
import collections
import filecmp
import json
import multiprocessing
import os
import pathlib
import random
import shutil
import struct
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import zlib

CUBE = ("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n"
        "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n")
QUICK = ["--tolerance", "10%", "--effort", "0"]
PARTS = ["--manifest", "parts/list.txt", "-o", "out", *QUICK]
SLOW = "slow.obj --depth 0.1 --edge-length 0.1%"  # of a track shoe: a minute


def pad(*arguments, **more):
    return subprocess.run([BIN / "pad", *map(str, arguments)], capture_output=True, text=True, stdin=more.pop("stdin", subprocess.DEVNULL),
                          **more)


def start(*arguments, **more):
    return subprocess.Popen([BIN / "pad", *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            stdin=subprocess.DEVNULL, **more)


def records(folder):
    """Every whole line of every shard's record."""
    found = []
    for file in sorted((folder / ".pad").glob("*.jsonl")):
        for line in file.read_text().splitlines():
            try:
                found.append(json.loads(line))
            except json.JSONDecodeError:
                pass
    return found


def files(folder):
    return {str(f.relative_to(folder)) for f in folder.rglob("*") if f.is_file() and ".pad" not in f.parts}


class ManifestTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="padder manifest ä ")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def put(self, name, text=CUBE):
        (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
        (self.folder / name).write_text(text)

    def run_pad(self, *arguments, code=0, **more):
        done = pad(*arguments, cwd=self.folder, **more)
        self.assertEqual(done.returncode, code, done.stderr)
        return done

    def run_json(self, *arguments, code=0):
        return json.loads(self.run_pad(*arguments, "--json", code=code).stdout)

    def counts(self, *arguments, code=0):
        report = self.run_json(*arguments, code=code)
        return report["made"], report["up_to_date"], report["failed"]

    def some(self, number):
        for k in range(number):
            self.put(f"parts/{k}.obj")
        self.put("parts/list.txt", "".join(f"{k}.obj\n" for k in range(number)))
        return PARTS

    def put_arm(self):
        shutil.copytree(pathlib.Path(__file__).resolve().parent.parent / "data/robot", self.folder / "robot")
        return "robot/arm_description/arm.urdf"

    def made_once(self, *lines):
        """The words for a list of these lines, each of which was made, and then found up to date."""
        self.put("list.txt", "\n".join(lines) + "\n")
        words = "--manifest", "list.txt", "-o", "out", "--tolerance", "10%"
        self.assertEqual(self.counts(*words), (len(lines), 0, 0))
        self.assertEqual(self.counts(*words), (0, len(lines), 0))
        return words

    def test_lines_have_options_and_the_tree_is_kept(self):
        self.put("in/a.obj"), self.put("in/sub/b c ü.obj"), self.put("in/bad.obj", "v 0 0 0\nf 1 2 3\n")
        self.put("in/list.txt", "\ufeff# a comment\r\n\na.obj\nsub/b c ü.obj\nbad.obj\n\"sub/b c ü.obj\" --unit mm --scale 2 -o fine/b.vtp\n")
        done = self.run_pad("--manifest", "in/list.txt", "-o", "out", *QUICK, code=1)
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        self.assertIn("bad.obj: line 2", done.stderr)
        self.assertEqual(files(self.folder / "out"), {"a.spheres.json", "sub/b c ü.spheres.json", "fine/b.vtp"})
        # The same bytes as one by one.
        self.run_pad("in/a.obj", *QUICK, "-o", "alone.spheres.json")
        self.assertEqual((self.folder / "alone.spheres.json").read_bytes().replace(b'"alone"', b'"a"'),
                         (self.folder / "out/a.spheres.json").read_bytes())
        # A folder, a pattern and a list on stdin give the same tree.
        for words in (["in"], ["in/*.obj", "in/*/*.obj"], ["--manifest", "-"]):
            shutil.rmtree(self.folder / "again", ignore_errors=True)
            stdin = None
            if words[-1] == "-":
                self.put("names", "in/a.obj\nin/sub/b c ü.obj\n")
                stdin = open(self.folder / "names")
                self.addCleanup(stdin.close)
            done = self.run_pad(*words, "-o", "again", *QUICK, code=0 if stdin else 1, stdin=stdin or subprocess.DEVNULL)
            self.assertEqual(len(files(self.folder / "again")), 2, done.stderr)

    def test_only_what_is_missing_or_changed_is_made(self):
        words = self.some(3)
        self.assertEqual(self.counts(*words), (3, 0, 0))
        self.assertEqual(self.counts(*words), (0, 3, 0))
        self.put("parts/1.obj", CUBE + "# changed\n")
        self.assertEqual(self.counts(*words), (1, 2, 0))
        (self.folder / "out/2.spheres.json").unlink()
        self.assertEqual(self.counts(*words), (1, 2, 0))
        (self.folder / "out/0.spheres.json").write_text("broken")
        self.assertEqual(self.counts(*words), (1, 2, 0))
        self.put("parts/list.txt", "0.obj\n1.obj --family 2\n2.obj --seconds 100\n")
        self.assertEqual(self.counts(*words), (1, 2, 0))
        self.assertEqual(self.counts(*words, "--unit", "mm"), (3, 0, 0))
        # Back again: the records of the first time do not stand for the files of the last.
        self.assertEqual(self.counts(*words), (3, 0, 0))
        # Another division of the work finds what is there.
        for shard in ("1/2", "2/2"):
            self.assertEqual(self.run_json(*words, "--shard", shard)["made"], 0)

    def test_no_result_takes_the_place_of_an_input_or_of_another_result(self):
        arm = self.put_arm()
        for name in ("x.obj", "y/x.obj", "parts/a.obj", "parts/s/b.obj"):
            self.put(name)
        self.put("parts/list.csv", "a.obj -o list.csv\n"), self.put("parts/over", "a.obj -o s/b.obj\ns/b.obj\n")
        self.put("two", f"x.obj\n{arm} --format obj -o x.obj\n"), self.put("mesh", f"{arm} -o robot/arm_description/meshes/fore.stl\n")
        self.put("pairs", f"{arm} -o z.urdf\n{arm} -o z.srdf\n"), self.put("list.srdf", f"{arm} -o list.urdf\n")
        (self.folder / "link").symlink_to("parts")
        before = {name: (self.folder / name).read_bytes() for name in files(self.folder)}
        read, both = "is a file that this run reads", "would both write"
        for words, sentence in (
                (["parts", "-o", "parts", "--format", "obj"], read), (["parts", "-o", "new/../parts", "--format", "obj"], read),
                (["parts/*.obj", "-o", "link", "--format", "obj"], read), ([".", "-o", ".", "--format", "obj"], read),
                (["parts", "-o", "link", "--format", "obj"], read), (["--manifest", "parts/over", "-o", "parts"], read),
                (["--manifest", "parts/list.csv", "-o", "parts"], read), (["--manifest", "two", "-o", "."], read),
                (["--manifest", "mesh", "-o", "."], read), (["--manifest", "pairs", "-o", "out"], both), (["--manifest", "list.srdf", "-o", "."], read),
                (["x.obj", "-o", "x.obj"], read), (["x.obj", "-o", "new/../x.obj"], read),
                (["x.obj", "--write-mesh", "new/../x.obj"], read), (["x.obj", "-o", "a.vtp", "-o", "new/../x.obj"], read),
                (["x.obj", "-o", "a.vtp", "-o", "new/../a.vtp"], both), (["x.obj", "-o", "a.obj", "--write-mesh", "./a.obj"], both),
                (["x.obj", "y/x.obj"], both), (["x.obj", "y/x.obj", "-o", "out/"], both),
                ([arm, "-o", "robot/arm_description/meshes/fore.stl"], read), ([arm, "robot/../" + arm, "-o", "out/"], both)):
            with self.subTest(words):
                done = self.run_pad(*words, *QUICK[:2], code=2)
                self.assertIn(sentence, done.stderr)
                self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
                self.assertEqual({name: (self.folder / name).read_bytes() for name in files(self.folder)}, before)

    def test_further_inputs_count(self):
        words = self.made_once(self.put_arm())
        mesh = self.folder / "robot/arm_description/meshes/fore.stl"
        mesh.write_bytes(b"changed" + mesh.read_bytes()[7:])  # in its header
        self.assertEqual(self.counts(*words), (1, 0, 0))

    def test_a_robot_without_its_srdf_is_made_again(self):
        words = self.made_once(self.put_arm())
        srdf, = (self.folder / "out").rglob("*.srdf")
        text = srdf.read_bytes()
        srdf.unlink()
        self.assertEqual(self.counts(*words), (1, 0, 0))
        self.assertEqual(srdf.read_bytes(), text)
        srdf.write_text("<robot/>")
        self.assertEqual(self.counts(*words), (1, 0, 0))
        self.assertEqual(self.counts(*words), (0, 1, 0))

    def test_included_files_of_an_mjcf_count(self):
        self.put("part.xml", "<mujoco><body name='b'><geom type='box' size='.1 .1 .1'/></body></mujoco>")
        self.put("whole.xml", "<mujoco><worldbody><include file='part.xml'/></worldbody></mujoco>")
        words = self.made_once("whole.xml -o out.xml")
        self.put("part.xml", "<mujoco><body name='b'><geom type='box' size='.1 .1 .2'/></body></mujoco>")
        self.assertEqual(self.counts(*words), (1, 0, 0))

    def test_the_buffers_of_a_gltf_count(self):
        points = struct.pack("<12f", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1)
        bytes_ = points + struct.pack("<12H", 0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2)
        views = [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24}]
        of = [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
              {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}]
        for name, file in ("escaped", "a b.bin"), ("plain", "a%20c.bin"):  # some exporters forget to escape
            uri = file.replace(" ", "%20")
            self.put(f"{name}.gltf", json.dumps({
                "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "bufferViews": views, "accessors": of,
                "buffers": [{"uri": uri, "byteLength": 72}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}]}))
            (self.folder / file).write_bytes(bytes_)
        words = self.made_once("escaped.gltf", "plain.gltf")
        for file in "a b.bin", "a%20c.bin":
            (self.folder / file).write_bytes(struct.pack("<f", 0.01) + bytes_[4:])
            self.assertEqual(self.counts(*words), (1, 1, 0))

    def test_a_damaged_record_costs_one_part(self):
        words = self.some(3)
        self.counts(*words)
        record = self.folder / "out/.pad/1-of-1.jsonl"
        record.write_bytes(record.read_bytes()[:-20])  # cut short by a crash
        self.assertEqual(self.counts(*words), (1, 2, 0))
        self.assertEqual(self.counts(*words), (0, 3, 0))
        record.write_text('null\n[]\n{"output": 3}\n\x00\n')
        self.assertEqual(self.counts(*words), (3, 0, 0))

    def test_what_stands_under_the_name_of_a_record(self):
        words = self.some(2)
        place = self.folder / "out/.pad"
        place.mkdir(parents=True)
        self.put("precious", "precious\n")
        os.mkfifo(place / "2-of-2.jsonl"), os.symlink("/dev/zero", place / "3-of-3.jsonl")  # of other divisions: passed over
        for make in (os.mkfifo, lambda name: os.symlink("../../precious", name), lambda name: os.symlink("/dev/zero", name), os.mkdir):
            make(place / "1-of-1.jsonl")
            done = self.run_pad(*words, code=1, timeout=60)
            self.assertEqual((done.stdout, done.stderr.count("\n")), ("", 1), done.stderr)
            self.assertIn("1-of-1.jsonl", done.stderr)
            os.rmdir(place / "1-of-1.jsonl") if make == os.mkdir else os.unlink(place / "1-of-1.jsonl")
        self.assertEqual((self.folder / "precious").read_text(), "precious\n")
        self.assertEqual(self.counts(*words), (2, 0, 0))

    def test_limits_end_one_part_and_no_other(self):
        self.put("parts/a.obj"), self.put("parts/b.obj")
        shutil.copy(ASSETS / "track_shoe.obj", self.folder / "parts/slow.obj")
        self.put("parts/list.txt", f"a.obj\n{SLOW} --seconds 0.5\nb.obj\n"
                 "slow.obj --memory 4M -o large.spheres.json\n")
        begin = time.monotonic()
        report = self.run_json(*PARTS, code=1)
        self.assertLess(time.monotonic() - begin, 60)
        self.assertIn("--seconds", report["records"][1]["error"])
        if any(name in (BIN / "pad").read_bytes() for name in (b"__asan_init", b"__tsan_init")):
            return  # they reserve terabytes, so that there is no limit of memory
        self.assertEqual([r["state"] for r in report["records"]], ["made", "failed", "made", "failed"])
        self.assertIn("--memory", report["records"][3]["error"])
        self.assertEqual(files(self.folder / "out"), {"a.spheres.json", "b.spheres.json"})

    def test_a_worker_that_is_killed_costs_one_part(self):
        self.put("parts/a.obj")
        shutil.copy(ASSETS / "track_shoe.obj", self.folder / "parts/slow.obj")
        self.put("parts/list.txt", f"{SLOW}\na.obj\n")
        run = start(*PARTS, "--workers", "1", cwd=self.folder)
        children = pathlib.Path(f"/proc/{run.pid}/task/{run.pid}/children")
        if not children.exists():
            run.kill(), run.communicate()
            self.skipTest("this kernel does not list children")
        while not children.read_text():
            time.sleep(0.01)
        os.kill(int(children.read_text().split()[0]), signal.SIGKILL)
        out, err = run.communicate()
        self.assertEqual(run.returncode, 1)
        self.assertIn("slow.obj: its worker was killed", err)
        self.assertEqual(files(self.folder / "out"), {"a.spheres.json"})

    def test_signals_end_it_cleanly_and_it_goes_on(self):
        self.put("parts/a.obj")
        shutil.copy(ASSETS / "track_shoe.obj", self.folder / "parts/slow.obj")
        self.put("parts/list.txt", f"a.obj\n{SLOW}\n")
        words = [*PARTS, "--workers", "1"]
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            shutil.rmtree(self.folder / "out", ignore_errors=True)  # a new record says that the run is under way
            run = start(*words, cwd=self.folder)
            while len(records(self.folder / "out")) < 1:
                time.sleep(0.01)
            time.sleep(0.1)
            run.send_signal(number)
            out, err = run.communicate()  # ends when the workers have ended, too: they share the pipes
            self.assertEqual(run.returncode, -9 if number == signal.SIGKILL else 128 + number, err)
            self.assertEqual(files(self.folder / "out"), {"a.spheres.json"})
        # What a killed run may have left is removed by the next one, and nothing else is.
        (self.folder / "out/a.spheres.json.part123").write_text("half")
        (self.folder / "out/mine.part123").write_text("mine")
        self.put("parts/list.txt", "a.obj\n")
        self.assertEqual(self.counts(*words), (0, 1, 0))
        self.assertEqual(files(self.folder / "out"), {"a.spheres.json", "mine.part123"})

    def test_two_runs_of_one_shard_are_refused(self):
        shutil.copy(ASSETS / "track_shoe.obj", self.folder / "slow.obj")
        self.put("list.txt", f"{SLOW}\n")
        words = "--manifest", "list.txt", "-o", "out", *QUICK
        run = start(*words, cwd=self.folder)
        while not (self.folder / "out/.pad/1-of-1.jsonl").exists():
            time.sleep(0.01)
        time.sleep(0.1)
        self.assertIn("another pad is at work", self.run_pad(*words, code=1).stderr)
        run.kill(), run.communicate()

    def test_wrong_usage_is_one_sentence(self):
        self.put("a.obj"), self.put("sub/a.obj"), self.put("sub/a.stl"), os.mkdir(self.folder / "empty")
        self.put("a.spheres.json")
        for name, text in {"option": "a.obj --no-such 1\n", "two": "a.obj\na.obj\n", "up": "../a.obj\n", "above": "a.obj -o ../x.spheres.json\n",
                           "root": "a.obj -o /x.spheres.json\n", "names": "a.obj b.obj\n", "value": "a.obj --tolerance x\n",
                           "format": "a.obj -o a.unknown\n", "none": "# nothing\n", "wide": "a\0.\0o\0", "nowhere": "a.obj -o sub/\n",
                           "conversion": "a.spheres.json -o a.csv --effort 2\n", "robot": "a.obj --robot-spheres 5\n"}.items():
            self.put(name + ".txt", text)
            done = self.run_pad("--manifest", name + ".txt", "-o", "out", code=1 if name == "none" else 2)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
            self.assertIn(name + ".txt", done.stderr)
        for words, code in ((["sub", "-o", "out"], 2), (["empty", "-o", "out"], 1), (["sub"], 2), (["*.stl", "-o", "out"], 1),
                            (["--manifest", "absent", "-o", "out"], 1), (["a.obj", "--shard", "1/2"], 2), (["a.obj", "--page"], 2),
                            (["sub", "-o", "a.obj"], 2), (["empty", "a.obj", "-o", "a.obj/x"], 1),
                            *((["empty", "a.obj", "-o", "out", "--shard", s], 2) for s in ("0/2", "3/2", "1", "1/", "/2", "x/2", "1/2x", "-1/2")),
                            (["empty", "a.obj", "-o", "out", "--page", "--shard", "1/2"], 2)):
            done = self.run_pad(*words, code=code)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        self.assertIn("** is no pattern", self.run_pad("sub/**/*.obj", "-o", "out", code=2).stderr)
        self.put("list.txt", "a.obj\n")
        for words in (["sub"], ["*.obj"], ["--manifest", "list.txt"], ["sub", "--format", "stl"]):
            self.assertIn("give -o FOLDER", self.run_pad(*words, "-o", "-", code=2).stderr)
        self.assertFalse((self.folder / "out").exists())

    def test_the_page_shows_every_part(self):
        self.put("parts/a.obj"), self.put("parts/bad.obj", "v 0 0 0\nf 1 2 3\n")
        self.put("parts/</script><b>.obj")
        os.rename(self.folder / "parts/<", self.folder / "parts/<b")
        self.run_pad("parts", "-o", "out", *QUICK, "--page", "-q", code=1)
        page = (self.folder / "out/index.html").read_text()
        data = json.loads(page.split("const parts = ")[1].split(";\n")[0])
        self.assertEqual([(p[0], p[3]) for p in data],
                         [("parts/<b/script><b>.obj", "done"), ("parts/a.obj", "done"), ("parts/bad.obj", "failed")])
        self.assertEqual(page.count("</script>"), 1)
        self.assertNotIn("<b>", page)
        for p in data[:2]:
            self.assertEqual((self.folder / "out" / p[2]).read_bytes()[:4], b"\x89PNG")
        self.assertIn("line 2", data[2][10])
        # The pictures are drawn once.
        before = {f: f.stat().st_mtime_ns for f in (self.folder / "out/.pad/pictures").rglob("*.png")}
        self.run_pad("parts", "-o", "out", *QUICK, "--page", "-q", code=1)
        self.assertEqual({f: f.stat().st_mtime_ns for f in (self.folder / "out/.pad/pictures").rglob("*.png")}, before)

    def test_the_trial(self):
        Trial(self.folder, 56, random.randrange(10**6), quiet=True).run()


class Trial:
    """Many parts, 8 shards: two are killed at random times and started again, one has a disk that is too small at first."""
    SHARDS = 8

    def __init__(self, folder, number, seed, quiet=False):
        self.folder, self.number, self.seed, self.quiet = folder, number, seed, quiet
        self.random = random.Random(seed)
        self.out = folder / "out"
        self.words = ["--manifest", folder / "parts/list.txt", "-q", *QUICK]
        self.cores = len(os.sched_getaffinity(0))
        self.began = time.monotonic()

    def say(self, *words):
        if not self.quiet:
            print(f"{time.monotonic() - self.began:6.1f} s:", *words, flush=True)

    def make_parts(self):
        """Grains of make_assets, each stretched in its own way, so that no two files are equal. Every 50th is a larger part."""
        self.base = []
        for k in range(3):
            place = self.folder / "base" / str(k)
            place.mkdir(parents=True)
            subprocess.run([BIN / "make_assets", "-o", place, "grain", "--frequency", str(2 + k), "--seed", str(self.seed + k)],
                           check=True, capture_output=True)
            self.base.append((place / "grain.obj").read_text().splitlines())
        self.base.append((ASSETS / "road_wheel.obj").read_text().splitlines())
        for k in range(100):
            (self.folder / "parts" / f"{k:02}").mkdir(parents=True)
        with multiprocessing.Pool(self.cores) as pool:
            names = pool.map(self.make_part, range(self.number), 500)
        self.lines = [name if k % 3 else f'"{name}" --family {k % 7 + 1}' for k, name in enumerate(names)]
        (self.folder / "parts/list.txt").write_text("\n".join(self.lines) + "\n")

    def make_part(self, k):
        name, own = f"{k % 100:02}/part {k}.obj", random.Random(f"{self.seed} {k}")
        stretch = [own.uniform(0.5, 2) for _ in range(3)]
        with open(self.folder / "parts" / name, "w") as f:
            for line in self.base[-1 if k % 50 == 49 else k % 3]:
                if line.startswith("v "):
                    line = "v " + " ".join(f"{float(x) * s:.9g}" for x, s in zip(line.split()[1:], stretch))
                f.write(line + "\n")
        return name

    def shard(self, index, out=None, workers=None):
        return start(*self.words, "-o", out or self.out, "--shard", f"{index}/{self.SHARDS}", "--workers", workers or max(1, self.cores // self.SHARDS),
                     "--threads", 1)

    def finish(self, run, expected=0):
        _, err = run.communicate()
        assert run.returncode == expected, (run.returncode, err)
        return err

    def small_disk(self, place):
        """A file system with room for half of a shard's assets; nothing where this may not be had."""
        place.mkdir()
        names = [f"{k % 100:02}/part {k}.spheres.json" for k in range(self.number)]
        mine = sum(zlib.crc32(name.encode()) % self.SHARDS == self.SHARDS - 1 for name in names)
        size = 4096 * (2 + mine // 2)
        return subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", place], capture_output=True).returncode == 0

    def kill_and_restart(self, runs):
        """Ends two shards with SIGKILL at random times, and starts them again. Returns how many were at work."""
        until = 0.3 if self.number < 1000 else self.number / 2500
        began, killed = time.monotonic(), 0
        for index, moment in enumerate(sorted(self.random.uniform(0.05, until) for _ in range(2)), 1):
            time.sleep(max(0, began + moment - time.monotonic()))
            runs[index].send_signal(signal.SIGKILL)
            runs[index].communicate()
            killed += runs[index].returncode == -9
            self.say(f"shard {index}: killed after {moment:.1f} s")
            runs[index] = self.shard(index)
        return killed

    def run(self):
        begin = time.monotonic()
        self.make_parts()
        self.say(f"seed {self.seed}, {self.number} parts written in {time.monotonic() - begin:.0f} s")
        begin = time.monotonic()
        disk = self.folder / "small disk"
        has_disk = self.small_disk(disk)
        try:
            runs = {k: self.shard(k, disk if has_disk and k == self.SHARDS else None) for k in range(1, self.SHARDS + 1)}
            self.killed = self.kill_and_restart(runs)
            for k in range(1, self.SHARDS):
                self.finish(runs[k])
                self.say(f"shard {k}: every part made")
            err = self.finish(runs[self.SHARDS], 1 if has_disk else 0)
            if has_disk:
                assert "No space left on device" in err and "goes on from here" in err, err
                assert not list(disk.rglob("*.part*"))
                self.say("shard 8: stopped on a full disk;", err.strip().splitlines()[-1])
                subprocess.run(["mount", "-o", "remount,size=90%", disk], check=True)
                self.finish(self.shard(self.SHARDS, disk, self.cores))
                shutil.copytree(disk, self.out, dirs_exist_ok=True)  # assets and records: nothing else is to be merged
        finally:
            if has_disk:
                subprocess.run(["umount", disk], check=True)
        self.check(has_disk, time.monotonic() - begin)

    def check(self, has_disk, seconds):
        made = collections.Counter(r["output"] for r in records(self.out) if not r["error"])
        assert len(made) == self.number, len(made)
        twice = sum(n - 1 for n in made.values())
        assert twice == 0, twice
        assert files(self.out) == set(made)
        begin = time.monotonic()
        last = pad(*self.words, "-o", self.out, "--json")
        report = json.loads(last.stdout)
        assert last.returncode == 0 and report["up_to_date"] == self.number, last.stderr
        self.say(f"{self.number} parts made in {seconds:.0f} s by {self.SHARDS} shards; {self.killed} killed; full disk: {has_disk}; made twice: {twice};"
                 f" all found up to date in {time.monotonic() - begin:.1f} s; {report['spheres']} spheres,"
                 f" {sum(r['cpu_seconds'] for r in report['records']):.0f} s of processor time")
        self.compare(min(self.number, 6 if self.quiet else 200))

    def compare(self, number):
        """Some parts padded alone give the same bytes."""
        for k in self.random.sample(range(self.number), number):
            words = self.lines[k].split('"')
            mesh, options = (words[1], words[2].split()) if len(words) > 1 else (words[0], [])
            name = pathlib.Path(mesh).stem + ".spheres.json"
            pad(self.folder / "parts" / mesh, *QUICK, *options, "-o", self.folder / name).check_returncode()
            assert filecmp.cmp(self.folder / name, self.out / pathlib.Path(mesh).parent / name, shallow=False), mesh
        self.say(f"{number} parts padded alone gave the same bytes")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=lambda p: pathlib.Path(p).resolve())
    parser.add_argument("--trial", type=int)
    parser.add_argument("--seed", type=int, default=1)
    arguments, rest = parser.parse_known_args()
    BIN = arguments.bin
    ASSETS = pathlib.Path(__file__).resolve().parents[2] / "assets"
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it, and so would pad
    if arguments.trial:
        with tempfile.TemporaryDirectory(prefix="padder-trial-") as place:
            Trial(pathlib.Path(place), arguments.trial, arguments.seed).run()
    else:
        unittest.main(argv=[sys.argv[0], *rest])
