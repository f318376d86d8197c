#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs every test that needs a GPU under one tool of NVIDIA's compute-sanitizer, and says what it found.

    sanitize.py BIN TOOL [--jobs N] [--seconds S] [--skip REGEX] [--only REGEX] [--log FOLDER]

BIN has the programs detect_*_test. TOOL is memcheck, racecheck, initcheck (of a build with -DPADDER_INITCHECK=ON) or
synccheck. Each test has a process of its own, N of them at a time. Prints a row for each program: tests that use the
GPU, those to their end, those with findings, those that failed otherwise; then the names of the tests that did not
end in S seconds, and the first lines of each finding. Exits with 1 if there is a finding.
"""
import argparse
import collections
import concurrent.futures
import pathlib
import re
import subprocess
import sys
import time

# Where a program has tests for each backend, their names say which; of these programs any test may use the GPU.
ANY_TEST = re.compile(r"detect_(cuda_|box|worlds)")
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
    started = time.monotonic()
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=min(options.seconds, max(1, options.until - started)))
    except subprocess.TimeoutExpired as late:
        return False, 0, False, time.monotonic() - started, (late.stdout or b"").decode(errors="replace")
    text = done.stdout + done.stderr
    if "before first instrumented API call" in text:  # it uses no GPU
        return True, None, False, 0, text
    summary = re.search(r"(?:ERROR SUMMARY: |RACECHECK SUMMARY: )(\d+)(?: hazards? displayed)?", text)
    found = int(summary.group(1)) if summary else -1
    failed = found < 0 or "[  FAILED  ]" in text or (found == 0 and done.returncode != 0)  # below 0: the tool itself failed
    return True, found, failed, time.monotonic() - started, text


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
    options = parser.parse_args()
    options.until = time.monotonic() + options.all_seconds
    programs = sorted(options.bin.glob("detect_*_test"))
    tests = [(p, t) for p in programs for t in tests_of(p)
             if re.search(options.only, f"{p.name} {t}") and not re.search(options.skip, f"{p.name} {t}")]
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
    print(f"{'program':32} tests ended findings failed skipped")
    for name, row in sorted(rows.items()) + [("all", sum(rows.values(), collections.Counter()))]:
        print(f"{name:32} {row['tests']:5} {row['ended']:5} {row['found']:8} {row['failed']:6} {row['skipped']:7}")
    print("\n".join(["did not end:"] + sorted(late) if late else ["all ended"]))
    print("\n\n".join(sorted(findings)))
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
