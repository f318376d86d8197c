# SPDX-License-Identifier: MIT
"""Every path that docs/contributing.md names in code type exists, and each of its questions is answered with one."""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOP = ("padding", "detect", "tools", "assets", "tests", "docs")
FILES = ("CMakeLists.txt", "LICENSE", "README.md", "CMakePresets.json")


def paths_in(text):
    spans = re.findall(r"`([^`\n]+)`", text)
    return [s for s in spans if " " not in s and (s in FILES or s.split("/")[0] in TOP and "/" in s) and "NAME" not in s]


def main():
    page = (ROOT / "docs/contributing.md").read_text()
    wrong = [f"docs/contributing.md names {p}, which does not exist" for p in paths_in(page) if not (ROOT / p).exists()]
    questions = re.findall(r"^\*\*(.+?)\*\*(.*?)(?=^\*\*|\Z)", page.split("## Questions and answers")[1], re.M | re.S)
    wrong += [f"the answer to {question!r} names no path" for question, answer in questions if not paths_in(answer)]
    if len(questions) < 10:
        wrong.append(f"{len(questions)} questions are answered instead of at least 10")
    # Functions that an answer names stand in the first file that it names.
    for question, answer in questions:
        for name in re.findall(r"`(\w+)\(\)`", answer):
            files = [ROOT / p for p in paths_in(answer) if (ROOT / p).is_file()]
            if not any(re.search(rf"\b{name}\b", f.read_text()) for f in files):
                wrong.append(f"the answer to {question!r} names {name}(), which none of its files has")
    print("\n".join(wrong) or f"{len(questions)} answers, every path exists")
    sys.exit(1 if wrong else 0)


main()
