#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Checks the shape of the source tree: licences, the direction of includes, sizes of folders, files and functions, and unnamed namespaces.

house_test.py ROOT [--report]    exits with 1 and one line for each place that breaks a rule; --report prints the includes
                                 between folders, the lines of code and the largest of each kind.
The rules are explained in docs/contributing.md.
"""
import collections
import os
import re
import shutil
import subprocess
import sys

MOST_FILES_IN_A_FOLDER = 20
MOST_LINES_OF_A_UNIT = 900  # a source file and the headers that only it includes
MOST_LINES_OF_A_FUNCTION = 80  # in padding/ and detect/

SOURCES = (".cpp", ".cu")
CODE = SOURCES + (".h",)
SCRIPTS = (".py", ".pyi", ".mjs", ".js", ".sh", ".cmake", ".glsl", ".css", ".html", "CMakeLists.txt")
TREES = ("padding", "detect", "tools", "assets", "tests", "docs")
SPDX = re.compile(r"SPDX-License-Identifier: (MIT|GPL-3\.0-or-later)\b")
INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.M)


def files_of(root):
    """Every file of the project, as paths relative to root. What a build or an editor leaves behind is not in it."""
    left_out = {"build", "node_modules", "__pycache__", ".git"}
    found = []
    for tree in TREES:
        for folder, folders, names in os.walk(os.path.join(root, tree)):
            folders[:] = [f for f in folders if f not in left_out and not f.startswith(".")]
            found += [os.path.relpath(os.path.join(folder, n), root) for n in names if not n.startswith(".")]
    return sorted(found)


class Tree:
    def __init__(self, root):
        self.root = root
        self.files = files_of(root)
        self.text = {f: self.read(f) for f in self.files if f.endswith(CODE) or f.endswith(SCRIPTS) or self.is_script(f)}
        known = set(self.files)
        self.includes = {}
        for f in self.text:
            if f.endswith(CODE):
                named = INCLUDE.findall(self.text[f])
                places = [(n, os.path.normpath(os.path.join(os.path.dirname(f), n))) for n in named]
                self.includes[f] = [p for pair in places for p in pair if p in known]

    def read(self, file):
        with open(os.path.join(self.root, file), encoding="utf-8") as f:
            return f.read()

    def is_script(self, file):
        if "." in os.path.basename(file):
            return False
        with open(os.path.join(self.root, file), "rb") as f:
            return f.read(2) == b"#!"

    def licence(self, file):
        found = SPDX.search("\n".join(self.text[file].split("\n", 5)[:5]))
        return found.group(1) if found else None

    def reached(self, file):
        """The files that `file` includes, directly or through others."""
        seen, todo = set(), [file]
        while todo:
            for f in self.includes.get(todo.pop(), []):
                if f not in seen:
                    seen.add(f)
                    todo.append(f)
        return seen


def check_licences(tree):
    for f in tree.text:
        if not tree.licence(f):
            yield f"{f}: no SPDX line of a licence (MIT or GPL-3.0-or-later) among its first five lines"
        elif tree.licence(f) == "MIT":
            for other in sorted(tree.reached(f)) if f.endswith(CODE) else []:
                if tree.licence(other) == "GPL-3.0-or-later":
                    yield f"{f}: is MIT and includes {other}, which is GPL"


def cycle_in(graph):
    """A cycle as a list of nodes, or nothing."""
    done, path = set(), []

    def visit(node):
        if node in path:
            return path[path.index(node):] + [node]
        if node in done:
            return None
        path.append(node)
        for other in sorted(graph.get(node, ())):
            found = visit(other)
            if found:
                return found
        path.pop()
        done.add(node)
        return None

    for node in sorted(graph):
        found = visit(node)
        if found:
            return found
    return None


def folder_graph(tree):
    """Folder to folder, by the headers: a source file is included by nothing, so that it can close no circle."""
    graph = collections.defaultdict(set)
    for f, others in tree.includes.items():
        for other in others:
            if f.endswith(".h") and os.path.dirname(f) != os.path.dirname(other):
                graph[os.path.dirname(f)].add(os.path.dirname(other))
    return graph


def check_direction(tree):
    files = cycle_in({f: set(others) for f, others in tree.includes.items()})
    if files:
        yield "files include each other in a circle: " + " -> ".join(files)
    folders = cycle_in(folder_graph(tree))
    if folders:
        yield "folders include each other in a circle: " + " -> ".join(folders)
    for f, others in tree.includes.items():
        for other in others:
            top, to = f.split("/")[0], other.split("/")[0]
            if top == "padding" and to in ("detect", "tools") or top == "detect" and to == "tools":
                yield f"{f}: includes {other}; the direction is padding, detect, tools"
            if top == "detect" and to == "padding" and not other.startswith("padding/asset/"):
                yield f"{f}: includes {other}; the detector knows of padding/asset only"


def units(tree):
    """Lines of each source file and of the headers that no other source file includes."""
    sources = [f for f in tree.includes if f.endswith(SOURCES) and not f.startswith("tests/")]
    users = collections.Counter(h for f in sources for h in tree.reached(f))
    for f in sources:
        own = [f] + [h for h in tree.reached(f) if users[h] == 1]
        yield sum(tree.text[g].count("\n") for g in own), f


def check_sizes(tree):
    for folder, count in collections.Counter(os.path.dirname(f) for f in tree.files).items():
        if count > MOST_FILES_IN_A_FOLDER and not folder.startswith("docs/results"):
            yield f"{folder}: {count} files; {MOST_FILES_IN_A_FOLDER} at most: give those with one purpose a folder"
    for lines, f in units(tree):
        if lines > MOST_LINES_OF_A_UNIT:
            yield f"{f}: {lines} lines with the headers that only it includes; {MOST_LINES_OF_A_UNIT} at most"


def ctags(tree, files, *options):
    return subprocess.run(["ctags", "--languages=c++", "--langmap=c++:+.cu", *options, "-I", "__launch_bounds__+", "-f", "-", *files],
                          cwd=tree.root, capture_output=True, text=True, check=True).stdout.splitlines()


def functions(tree):
    """Lines, file and name of each function in padding/ and detect/, by Universal Ctags."""
    files = [f for f in tree.includes if f.startswith(("padding/", "detect/"))]
    for line in ctags(tree, files, "--c++-kinds=f", "--fields=+ne"):
        begin, end = re.search(r"\tline:(\d+)", line), re.search(r"\tend:(\d+)", line)
        if begin and end:
            name, file = line.split("\t")[:2]
            yield int(end.group(1)) - int(begin.group(1)) + 1, file, name


def has_ctags():
    return shutil.which("ctags") and "Universal" in subprocess.run(
        ["ctags", "--version"], capture_output=True, text=True).stdout


def check_functions(tree):
    if not has_ctags():
        print("lengths of functions are not checked: there is no Universal Ctags (Debian: universal-ctags)")
        return
    for lines, file, name in functions(tree):
        if lines > MOST_LINES_OF_A_FUNCTION:
            yield f"{file}: function {name} has {lines} lines; {MOST_LINES_OF_A_FUNCTION} at most"


# What pip compiles up to eight sources at once of (CMAKE_UNITY_BUILD), so that their unnamed namespaces become one: each room of
# a library under the library's name. The rooms of padding are read from its CMakeLists.txt.
def libraries(tree):
    rooms = {}
    for name, folders in re.findall(r"^ *padder_rooms\((\w+) ([\w /]+)\)", tree.text["padding/CMakeLists.txt"], re.M):
        rooms.update({f"padding/{folder}": name for folder in folders.split()})
    rooms.update({"padding": "padding", "tools/pad": "pad", "tools/pad/manifest": "pad", "tools/detect": "detect", "tools/settle": "settle", "tools/settle/page": "settle", "tools/preview": "preview", "tools/python": "python"})
    rooms.update({f"detect/{folder}".rstrip("/"): "padder_detect" for folder in ("", "core", "scene", "omp", "boxes")})
    return {**rooms, "detect/mpi": "detect_mpi"}


def check_unnamed_namespaces(tree):
    """A name that two sources of one library define in unnamed namespaces, or one of them and a header that they include."""
    rooms = libraries(tree)
    sources = {f: rooms[os.path.dirname(f)] for f in tree.includes if f.endswith(".cpp") and os.path.dirname(f) in rooms}
    headers = collections.defaultdict(set)
    for f, library in sources.items():
        for h in tree.reached(f):
            headers[h].add(library)
    found = collections.defaultdict(set)
    for tag in ctags(tree, [*sources, *headers], "--c++-kinds=cefgstuv", "--fields=+nsS"):
        name, file = tag.split("\t")[:2]
        scope = re.search(r"\tnamespace:(\S+?)(::__anon\w+)?(\t|$)", tag)
        if not scope or name.startswith("__anon"):
            continue
        if file in sources and scope.group(2):
            found[sources[file], scope.group(1), name].add(file)
        elif file in headers and "\tsignature:" not in tag:  # functions may be overloaded
            for library in headers[file]:
                found[library, scope.group(1), name].add(file)
    for (_, _, name), files in sorted(found.items()):
        if len(files) > 1 and any(f in sources for f in files):
            yield f"{' and '.join(sorted(files))}: both define {name}, and a library can be compiled as one source: give one a name that says more"


def report(tree):
    for folder, others in sorted(folder_graph(tree).items()):
        print(folder, "->", ", ".join(sorted(others)))
    lines = collections.Counter()
    for f, text in tree.text.items():
        lines[f.split("/")[0]] += sum(1 for line in text.split("\n") if line.strip())
    print("\nlines of code that are not blank:", dict(lines))
    print("largest folders:", collections.Counter(os.path.dirname(f) for f in tree.files).most_common(6))
    print("largest units:", sorted(units(tree))[:-9:-1])
    if has_ctags():
        print("longest functions:", sorted(functions(tree))[:-9:-1])


def main():
    if len(sys.argv) < 2 or not os.path.isdir(os.path.join(sys.argv[1], "padding")):
        sys.exit(__doc__)
    tree = Tree(sys.argv[1])
    if "--report" in sys.argv:
        report(tree)
    broken = [line for check in (check_licences, check_direction, check_sizes, check_functions, check_unnamed_namespaces) for line in check(tree)]
    for line in broken:
        print(line)
    print(f"{len(tree.text)} files looked at, {len(broken)} places that break a rule")
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
