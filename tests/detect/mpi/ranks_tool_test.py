#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""ranks_tool_test.py BIN MPIRUN: detect as mpirun starts it. One hash for any number of ranks; failures end all ranks."""
import glob
import json
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time

BIN, MPIRUN = os.path.abspath(sys.argv[1]), sys.argv[2]
DETECT = os.path.join(BIN, "detect")


def run(ranks, *arguments):
    return subprocess.run([MPIRUN, "--oversubscribe", "-n", str(ranks), DETECT, *arguments], capture_output=True, text=True,
                          timeout=120)


def expect(truth, *what):
    if not truth:
        sys.exit("\n".join(map(str, ("ranks_tool_test.py: this should not be:",) + what)))


def write_scenes():
    with open("dense.json", "w") as f:
        json.dump({"format": "padder.scene", "version": 1, "spheres": [{"generate": "dense", "count": 10000}]}, f)
    with open("large.json", "w") as f:
        json.dump({"format": "padder.scene", "version": 1, "spheres": [{"generate": "poly100", "count": 4000000}]}, f)
    numbers = [v for x in range(30) for y in range(20) for z in range(10) for v in (0.9 * x, 0.95 * y, 0.97 * z, 0.5)]
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({len(numbers) // 4}, 4), }}"
    head = head.ljust(127 - 10 - 1 + 1) + "\n"
    with open("spheres.npy", "wb") as f:
        f.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + struct.pack(f"<{len(numbers)}d", *numbers))


def same_hashes():
    for scene, numbers in ("dense.json", (1, 7)), ("spheres.npy", (3,)):
        one = subprocess.run([DETECT, scene, "--backend", "omp", "-q", "--hash"], capture_output=True, text=True)
        expect(one.returncode == 0 and len(one.stdout) == 17, one)
        for ranks in numbers:
            many = run(ranks, scene, "--backend", "omp", "-q", "--hash")
            expect(many.returncode == 0 and many.stdout == one.stdout, ranks, scene, one, many)
    report = json.loads(run(3, "dense.json", "--backend", "omp", "--json").stdout)
    said = run(2, "dense.json", "--backend", "omp", "-q", "-v").stderr
    expect([line.split()[1] for line in said.splitlines()] == ["cut", "exchange", "detect", "total"], said)
    expect(report["ranks"] == 3 and report["spheres"] == 10000 and report["contacts"] > 25000, report)


def bench():
    bench = os.path.join(BIN, "bench")
    made = subprocess.run([MPIRUN, "--oversubscribe", "-n", "3", bench, "ranks", "--backend", "omp", "--spheres", "3000,20000",
                           "--repeat", "1", "--threads", "1", "--json"], capture_output=True, text=True, timeout=120)
    expect(made.returncode == 0, made)
    rows = json.loads(made.stdout)["rows"]  # by ranks and by threads, of each size; differing hashes are an error
    expect([(r["spheres"], r["by"]) for r in rows] == [(n, by) for n in (3000, 20000) for by in ("ranks", "threads")], rows)
    expect(all(r["devices"] == 3 and r["contacts"] > r["spheres"] and r["seconds"] > 0 for r in rows), rows)
    alone = subprocess.run([bench, "ranks"], capture_output=True, text=True)
    expect(alone.returncode == 2 and "mpirun" in alone.stderr, alone)


def files():
    os.symlink("behind.npy", "contacts.npy")  # the file that the link leads to is written
    made = run(3, "dense.json", "--backend", "omp", "-o", "contacts.npy", "--json")
    expect(made.returncode == 0, made)
    expect(os.path.islink("contacts.npy") and os.path.isfile("behind.npy"), made)
    expect(os.path.getsize("contacts.npy") == 256 + json.loads(made.stdout)["contacts"] * (16 + 80), made)


def wrong_usage():
    for arguments, code, words in ((["absent.json"], 1, "cannot open absent.json"), (["dense.json", "--zzz"], 2, "--zzz"),
                                   (["dense.json", "--stages"], 2, "--stages"), (["dense.json", "--devices", "2"], 2, "--devices"),
                                   (["dense.json", "-o", "c.csv"], 2, ".npy"), (["dense.json", "-o", "no/c.npy"], 1, "no/c.npy")):
        failed = run(2, *arguments)
        said = [line for line in failed.stderr.splitlines() if line.startswith("detect: ")]
        expect(failed.returncode == code and len(said) == 1 and words in said[0], arguments, failed)


def children(of):
    found = []
    for status in glob.glob("/proc/[0-9]*/stat"):
        try:
            with open(status) as f:
                name, rest = f.read().rsplit(")", 1)
        except OSError:
            continue
        if name.endswith("(detect") and int(rest.split()[1]) == of:
            found.append(int(name.split()[0]))
    return found


def a_killed_rank_ends_all():
    job = subprocess.Popen([MPIRUN, "--oversubscribe", "-n", "3", DETECT, "large.json", "--backend", "omp", "-o", "killed.npy"],
                           stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while len(children(job.pid)) < 3:
        expect(job.poll() is None, "it ended by itself")
        time.sleep(0.02)
    time.sleep(0.5)
    victim = max(children(job.pid))
    start = time.monotonic()
    os.kill(victim, signal.SIGKILL)
    said = job.communicate(timeout=60)[1]
    expect(time.monotonic() - start < 20, "the others went on")
    expect(job.returncode != 0 and "rank" in said and "signal 9" in said, job.returncode, said)
    expect(not os.path.exists("killed.npy"), "a partial file")


def a_signal_leaves_no_file():
    for number in signal.SIGINT, signal.SIGTERM:
        job = subprocess.Popen([MPIRUN, "--oversubscribe", "-n", "3", DETECT, "large.json", "--backend", "omp", "-o", "ended.npy"],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while not os.path.exists("ended.npy.part"):
            expect(job.poll() is None, "it ended by itself")
            time.sleep(0.02)
        job.send_signal(number)
        said = job.communicate(timeout=60)[1]
        expect(job.returncode != 0 and not glob.glob("ended.npy*"), number, job.returncode, said, glob.glob("ended.npy*"))


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    write_scenes()
    same_hashes()
    bench()
    files()
    wrong_usage()
    a_killed_rank_ends_all()
    a_signal_leaves_no_file()
