#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""cli_reference.py BIN DOC [--check]: docs/cli.md from what the programs in BIN say of themselves with --help.

With --check nothing is written: it leaves with 1 when DOC is not what it would write, and says how to renew it.
"""
import difflib
import os
import re
import subprocess
import sys

HEAD = """\
# The command line

What each program says of itself with `--help`. Made by `cmake --build BUILD --target cli_reference`; a test fails when it is out of date.

    tools/run NAME ARGS…     on a fresh machine: installs what is missing, builds, runs
    build/cpu/bin/NAME ARGS…

Everywhere: results go to stdout, talk and errors to stderr. `--json` prints one JSON document on stdout and nothing else there; `-q` is silent but
for errors, each one sentence: what, in which file and place, what to do. Exit code: 0 done, 1 the work failed, 2 wrong usage; a file is
written whole or not at all. With `--json` a failure of the work is a document, too: `input` and `error`, the sentence of stderr. `-` as an input is
stdin and as an output is stdout. A progress bar shows on a terminal only, and says after two seconds about how long the rest takes. No program colours its text, and each takes `--colour never` from scripts. `assets/reports/` has a JSON Schema of
what each prints with `--json`. A LENGTH is in the mesh's own unit, or a share of
the diagonal of its bounding box when it ends in `%`.
"""
TOOLS = {
    "pad": ("A mesh to a cluster of spheres: [padding](padding.md), [tolerance](tolerance.md), [formats](formats.md).", []),
    "detect": ("A scene to its contacts: [detector](detector/use.md), [scenes](scenes.md).", []),
    "settle": ("Grains and padded bodies in motion: [settling](detector/settle.md).", []),
    "preview": ("A page or a picture: [preview](preview.md).", []),
    "bench": ("The measurements behind the [results](results).", [["--list"]]),
    "make_assets": ("The parts in assets/, or the same with other dimensions.", "parts"),
}


def said(folder, name, *arguments):
    # The name as it is typed, not the folder it happens to lie in.
    return subprocess.run([name, *arguments], executable=os.path.join(folder, name), check=True, capture_output=True,
                          text=True).stdout.strip("\n").replace(folder + os.sep, "")


def block(text):
    return "\n```text\n" + "\n".join(line.rstrip() for line in text.splitlines()) + "\n```\n"


def reference(folder):
    out = HEAD
    for name, (what, more) in TOOLS.items():
        text = said(folder, name, "--help")
        out += f"\n## {name}\n\n{what}\n" + block(text)
        if more == "parts":
            more = [[part, "--help"] for part in re.findall(r"^  (\w+)", text.split("Subcommands:")[1], re.M)]
        for arguments in more:
            out += f"\n`{name} {' '.join(arguments)}`\n" + block(said(folder, name, *arguments))
    return out


def main():
    folder, path = os.path.abspath(sys.argv[1]), sys.argv[2]
    fresh = reference(folder)
    try:
        with open(path, encoding="utf-8") as f:
            old = f.read()
    except FileNotFoundError:
        old = ""
    if "--check" not in sys.argv:
        if fresh != old:
            with open(path, "w", encoding="utf-8") as f:
                f.write(fresh)
    elif fresh != old:
        sys.stdout.writelines(difflib.unified_diff(old.splitlines(True), fresh.splitlines(True), path, "the programs"))
        sys.exit(f"\n{path} is out of date: cmake --build BUILD --target cli_reference renews it")


main()
