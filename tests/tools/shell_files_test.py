#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""shell_files_test.py BIN: the man pages and completions name every option, and the shells and groff take them.

bash completes as a user's does; zsh, fish and groff read the files where they are installed.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile

TOOL = os.path.join(os.path.dirname(__file__), "../../tools/shell_files.py")


def text_of(*path):
    with open(os.path.join(*path), encoding="utf-8") as f:
        return f.read()


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode or done.stderr:
        sys.exit(f"{' '.join(command)}: {done.stderr or done.stdout}")
    return done.stdout


def completed(folder, *words):
    script = (f"source {folder}/bash/{words[0]}; COMP_WORDS=({' '.join(repr(w) for w in words)}); COMP_CWORD={len(words) - 1}; "
              f"_{words[0]}; echo ${{COMPREPLY[@]}}")
    return run("bash", "-c", script).split()


bin_folder = os.path.abspath(sys.argv[1])
with tempfile.TemporaryDirectory() as folder:
    run(sys.executable, TOOL, bin_folder, folder)
    for name in ("pad", "detect", "preview", "bench"):
        told = subprocess.run([name, "--help"], executable=os.path.join(bin_folder, name), capture_output=True, text=True, check=True)
        table = told.stdout.split("\nOptions:\n")[1].split("\n\n")[0]
        options = [o for line in re.findall(r"^  (-\S+)", table, re.M) for o in line.split(",")]
        assert len(options) > 8, options
        page, zsh, fish = text_of(folder, "man1", name + ".1"), text_of(folder, "zsh", "_" + name), text_of(folder, "fish", name + ".fish")
        assert set(options) == set(completed(folder, name, "-")), (name, completed(folder, name, "-"))
        for option in options:
            assert "\\fB" + option.replace("-", "\\-") + "\\fR" in page, option
            assert f"'*{option}[" in zsh, option
            assert re.search(rf" -{'l' if option.startswith('--') else 's'} {option.lstrip('-')}\b", fish), option
        for program, arguments in (("zsh", ["-n", f"{folder}/zsh/_{name}"]), ("fish", ["--no-execute", f"{folder}/fish/{name}.fish"]),
                                   ("groff", ["-Kutf8", "-man", "-ww", "-z", "-Tutf8", f"{folder}/man1/{name}.1"])):
            if shutil.which(program):
                run(program, *arguments)
            else:
                print(f"{program} is not installed: its file of {name} was not read")
    assert completed(folder, "pad", "--repair", "s") == ["sheet"], completed(folder, "pad", "--repair", "s")
    assert "mujoco" in completed(folder, "pad", "--format", "mu")
    assert completed(folder, "detect", "--precision", "f") == ["fast"]
print("man pages and completions of four programs")
