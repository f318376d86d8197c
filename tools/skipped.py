#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""skipped.py JUNIT.xml [BUILD]: a table of the tests that ctest skipped, and why, from the file that ctest --output-junit wrote.

Tests that were skipped for the same reason stand in one row. Prints nothing when none was skipped. With the folder that
was built, a second table says of each test program how many of its tests passed, were skipped and failed.
"""
import collections
import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as tree


def reason_of(case):
    """The test's own sentence: what GTEST_SKIP printed below its file and line, else its last line."""
    lines = [line.strip() for line in (case.findtext("system-out") or "").splitlines() if line.strip()]
    for k, line in enumerate(lines):
        if re.search(r"\.(cpp|cu|h):\d+: Skipped$", line) and k + 1 < len(lines):
            return lines[k + 1]
    said = [line for line in lines if not re.match(r"(\[ |Note: |Running main|[0-9]+ FAILED)", line)]
    return said[-1] if said else "it did not say"


def program(test):
    """What the test runs: a test program, or the test's own name where something else starts it."""
    name = os.path.basename(test.get("command", [""])[0])
    return name if name.endswith("_test") else test["name"]


def print_programs(build):
    listed = json.loads(subprocess.check_output(["ctest", "--test-dir", build, "--show-only=json-v1"]))
    programs = {test["name"]: program(test) for test in listed["tests"]}
    rows = collections.defaultdict(collections.Counter)
    for case in tree.parse(sys.argv[1]).getroot().iter("testcase"):
        rows[programs.get(case.get("name"), case.get("name"))][case.get("status")] += 1
    print("\n| program | passed | skipped | failed |\n| --- | ---: | ---: | ---: |")
    for name, row in sorted(rows.items()):
        print(f"| {name} | {row['run']} | {row['notrun'] + row['disabled']} | {row['fail']} |")


def print_skipped():
    rows = {}
    for case in tree.parse(sys.argv[1]).getroot().iter("testcase"):
        skipped = case.find("skipped")  # a program that is not there has failed, whatever ctest calls it
        if skipped is not None and skipped.get("message") != "Unable to find executable":
            rows.setdefault(reason_of(case), []).append(case.get("name"))
    if not rows:
        return
    print(f"\nSkipped: {sum(map(len, rows.values()))} tests\n\n| tests | which | why |\n| ---: | --- | --- |")
    for reason, names in sorted(rows.items(), key=lambda row: -len(row[1])):
        shown = ", ".join(names[:2]) + (", …" if len(names) > 2 else "")
        print(f"| {len(names)} | {shown} | {reason} |".replace("\n", " "))


print_skipped()
if len(sys.argv) > 2:
    print_programs(sys.argv[2])
