#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs every test that needs a GPU under one tool of NVIDIA's compute-sanitizer, and says what it found.

    sanitize.py BIN TOOL [--jobs N] [--seconds S] [--skip REGEX] [--only REGEX]
                [--log FOLDER] [--after FILE] [--ended FILE]

BIN has the programs detect_*_test. TOOL is memcheck, racecheck, initcheck (of a build with -DPADDER_INITCHECK=ON) or
synccheck. Each test has a process of its own, N of them at a time. Prints a row for each program: tests that use the
GPU, those to their end, those with findings, those that failed otherwise; then the names of the tests that did not
end in S seconds, and the first lines of each finding. Exits with 1 if there is a finding. FOLDER/tests.txt gets a line
for each test as it ends, FOLDER/findings.txt each finding. Both FILEs are such tests.txt of other runs: with `--after`
tests begin in the order of the times there, and with `--ended` those that ended there without a finding are left out.
Under racecheck: --skip Large, and PADDER_TEST_EVERY=5 in the environment (docs/stability.md).
"""
import argparse
import collections
import concurrent.futures
import os
import pathlib
import re
import signal
import subprocess
import sys
import time

# Where a program has tests for each backend, their names say which; of these programs any test may use the GPU.
ANY_TEST = re.compile(r"detect_(cuda_|box|worlds)")
# What begins a report of a test that has no summary, because it was stopped.
REPORT = re.compile(r"^========= (?:Error: |Warning: |Invalid |Uninitialized |Barrier error)", re.M)
# Several threads start kernels on one GPU. racecheck loses some of these kernels unless each start waits
# for the kernel's end, which changes nothing of what it looks for: races within a block.
THREADS = re.compile("CudaResident|OtherThreadsUseTheDefaultStream")
# Ends the GPU's context on purpose. Its fault reaches other processes that are under a tool.
FAULTS = "AfterAFaultOfTheCallersASentence"


def tests_of(program):
    """The names that gtest lists, those that need a GPU."""
    listed = subprocess.run([program, "--gtest_list_tests"], capture_output=True, text=True).stdout
    suite = ""
    for line in listed.splitlines():
        name = line.split("#")[0].rstrip()
        if not line.startswith(" "):
            suite = name
        elif name.strip() != FAULTS and (ANY_TEST.match(program.name) or "cuda" in suite + name):
            yield suite + name.strip()


def run(program, test, options):
    """One test: (ends, findings, failed, seconds, text)."""
    command = ["compute-sanitizer", "--tool", options.tool, "--print-limit", "20", "--error-exitcode", "99",
               "--target-processes", "application-only", str(program), f"--gtest_filter={test}"]
    threads = max(1, (os.cpu_count() or 1) // options.jobs)  # S seconds are the only limit of time
    environment = os.environ | {"PADDER_WATCHDOG": "0", "OMP_NUM_THREADS": str(threads), "OMP_WAIT_POLICY": "passive"}
    if options.tool == "racecheck" and THREADS.search(f"{program.name} {test}"):
        environment["CUDA_LAUNCH_BLOCKING"] = "1"
    started = time.monotonic()
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                               errors="replace", start_new_session=True)
    try:
        text, _ = process.communicate(timeout=min(options.seconds, max(1, options.until - started)))
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)  # the test, too, which would go on without its tool
        text, _ = process.communicate()
        return False, len(REPORT.findall(text)), False, time.monotonic() - started, text
    if "before first instrumented API call" in text:  # it uses no GPU
        return True, None, False, 0, text
    summary = re.search(r"(?:ERROR SUMMARY: |RACECHECK SUMMARY: )(\d+)(?: hazards? displayed)?", text)
    found = int(summary.group(1)) if summary and "Internal Sanitizer Error" not in text else -1
    failed = found < 0 or "[  FAILED  ]" in text or (found == 0 and process.returncode != 0)  # below 0: the tool itself failed
    return True, found, failed, time.monotonic() - started, text


def rows_of(log):
    """Of a tests.txt: seconds, ends or late, findings, passed or failed, program, test."""
    return [line.split() for line in log.read_text().splitlines()]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("tool", choices=["memcheck", "racecheck", "initcheck", "synccheck"])
    parser.add_argument("--jobs", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=300, help="of a test")
    parser.add_argument("--all-seconds", type=float, default=1e9, help="of all tests together")
    parser.add_argument("--only", default="")
    parser.add_argument("--skip", default="$^")
    parser.add_argument("--log", type=pathlib.Path)
    parser.add_argument("--after", type=pathlib.Path)
    parser.add_argument("--ended", type=pathlib.Path)
    options = parser.parse_args()
    options.until = time.monotonic() + options.all_seconds
    programs = sorted(options.bin.glob("detect_*_test"))
    tests = [(p, t) for p in programs for t in tests_of(p)
             if re.search(options.only, f"{p.name} {t}") and not re.search(options.skip, f"{p.name} {t}")]
    if options.after:
        seconds = {(program, test): float(took) for took, _, _, _, program, test in rows_of(options.after)}
        tests.sort(key=lambda one: seconds.get((one[0].name, one[1]), 0))
    if options.ended:
        ended = {tuple(row[4:]) for row in rows_of(options.ended) if row[1:4] == ["ends", "0", "passed"]}
        tests = [(p, t) for p, t in tests if (p.name, t) not in ended]
    rows, late, findings = collections.defaultdict(collections.Counter), [], []
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        waiting = {pool.submit(run, p, t, options): (p.name, t) for p, t in tests}
        for job in concurrent.futures.as_completed(waiting):
            name, test = waiting[job]
            ends, found, failed, seconds, text = job.result()
            if found is None:
                continue
            rows[name].update(tests=1, ended=ends, found=found > 0, failed=failed, skipped="[  SKIPPED ]" in text)
            if not ends:
                late.append(f"{name} {test}")
            if found > 0 or failed:
                kept = [l for l in text.splitlines() if l.startswith("=========") or "Failure" in l or "what()" in l]
                findings.append(f"{name} {test}: {found} ({seconds:.0f} s)\n" + "\n".join(kept[:24]))
            if options.log:
                options.log.mkdir(parents=True, exist_ok=True)
                with open(options.log / "tests.txt", "a") as log:
                    log.write(f"{seconds:7.1f} {'ends' if ends else 'late'} {found} {'failed' if failed else 'passed'} {name} {test}\n")
                if found > 0 or failed:
                    with open(options.log / "findings.txt", "a") as log:
                        log.write(findings[-1] + "\n\n")
    print(f"{'program':32} tests ended findings failed skipped")
    for name, row in sorted(rows.items()) + [("all", sum(rows.values(), collections.Counter()))]:
        print(f"{name:32} {row['tests']:5} {row['ended']:5} {row['found']:8} {row['failed']:6} {row['skipped']:7}")
    print("\n".join(["did not end:"] + sorted(late) if late else ["all ended"]))
    print("\n\n".join(sorted(findings)))
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
