#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""when_changed.py STAMP INPUT… -- COMMAND…: runs a test, unless it has passed and nothing that it reads has changed since.

For tests that take seconds and read little: packages, and pages in a browser. An INPUT is a file or a folder with all that is in
it; the command, its programs of Debian's (by dpkg's status file) and this file count as well. The exit code is the command's;
only 0 is remembered, in STAMP. With PADDER_EVERY_TEST=1 in the environment (tools/test --long) it runs in any case.
"""
import hashlib
import os
import pathlib
import subprocess
import sys


def fingerprint(inputs, command):
    sums = hashlib.blake2b("\0".join(command).encode())
    for top in [__file__, "/var/lib/dpkg/status", *inputs]:
        top = pathlib.Path(top)
        files = [top] if top.is_file() else sorted(f for f in top.rglob("*") if f.is_file() and "__pycache__" not in f.parts)
        for file in files:
            sums.update(f"\0{file}\0".encode())
            with open(file, "rb") as content:
                sums.update(hashlib.file_digest(content, "blake2b").digest())
    return sums.hexdigest()


def main():
    split = sys.argv.index("--")
    stamp, inputs, command = pathlib.Path(sys.argv[1]), sys.argv[2:split], sys.argv[split + 1:]
    mark = fingerprint(inputs, command)
    if os.environ.get("PADDER_EVERY_TEST") != "1" and stamp.is_file() and stamp.read_text() == mark:
        print("it has passed, and nothing that it reads has changed since (PADDER_EVERY_TEST=1 runs it again)")
        return 0
    stamp.unlink(missing_ok=True)
    code = subprocess.run(command).returncode
    if code == 0:
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(mark)
    return code


if __name__ == "__main__":
    sys.exit(main())
