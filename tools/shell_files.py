#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""shell_files.py BIN OUT: man pages, and completions for bash, zsh and fish, from what the programs in BIN say of themselves.

Writes OUT/man1/NAME.1, OUT/bash/NAME, OUT/zsh/_NAME and OUT/fish/NAME.fish. The source is --help, as for docs/cli.md; the words
that an option takes are those that the program names when it is given another one.
"""
import os
import re
import subprocess
import sys

TOOLS = {
    "pad": "covers triangle meshes and robots with spheres",
    "detect": "finds the contacts between spheres",
    "preview": "shows a cluster or a scene as a page or a picture",
    "bench": "measures padding and detection",
}


class Option:
    def __init__(self, names, value, text):
        self.names, self.value, self.text, self.words = names, value, text, []


class Help:
    """The parts of --help: examples, paragraphs, usage and options."""

    def __init__(self, bin_folder, name):
        self.name, self.program = name, os.path.join(bin_folder, name)
        self.lines = self.said("--help").stdout.splitlines()
        self.version = self.said("--version").stdout.strip()
        usage = next(k for k, line in enumerate(self.lines) if line.startswith("Usage: "))
        self.usage = self.lines[usage].removeprefix("Usage: ")
        blank = self.lines.index("")
        self.examples = self.lines[1:blank]
        self.paragraph = " ".join(self.lines[blank + 1:usage]).strip()
        self.options, self.inputs = [], []
        self.read_table("Options:", self.options)
        self.read_table("Positionals:", self.inputs)
        for option in self.options:
            if option.value:
                option.words = self.words_of(option)

    def said(self, *arguments):
        return subprocess.run([self.name, *arguments], executable=self.program, capture_output=True, text=True, check=False)

    def read_table(self, title, rows):
        if title not in self.lines:
            return
        for line in self.lines[self.lines.index(title) + 1:]:
            if not line:
                break
            found = re.match(r"  (\S+(?: \S+)*?)(?:  +(.*))?$", line[:25].rstrip() + "  " + line[25:].strip()
                             if len(line) > 25 and line[23:25] == "  " and line[25] != " " else line)
            if line.startswith(" " * 25):
                rows[-1].text = (rows[-1].text + " " + line.strip()).strip()
                continue
            names, _, value = found.group(1).partition(" ")
            rows.append(Option(names.split(","), value, found.group(2) or ""))

    def words_of(self, option):
        told = self.said("x", option.names[-1], "?").stderr
        found = re.search(r"takes one of (.*), not \"\?\"|there are ([a-z -]+)$", told.strip(), re.M)
        if not found:
            return []
        return re.split(r", | and ", found.group(1)) if found.group(1) else found.group(2).split()

    def names(self):
        return [name for option in self.options for name in option.names]


def man(h):
    def plain(text):
        text = text.replace("\\", "\\e").replace("-", "\\-")
        return "\\&" + text if text.startswith((".", "'")) else text
    out = [f'.TH {h.name.upper()} 1 "" "{h.version}" "User Commands"', ".SH NAME", f"{h.name} \\- {plain(TOOLS[h.name])}",
           ".SH SYNOPSIS", f".B {plain(h.usage)}", ".SH DESCRIPTION", plain(h.paragraph), ".SH OPTIONS"]
    for option in h.inputs + h.options:
        names = ", ".join(f"\\fB{plain(name)}\\fR" for name in option.names)
        out += [".TP", names + (f" \\fI{plain(option.value)}\\fR" if option.value else ""), plain(option.text)]
    out += [".SH EXAMPLES", ".nf", *(plain(line.strip()) for line in h.examples), ".fi", ".SH EXIT STATUS",
            "0 done, 1 the work failed, 2 wrong usage."]
    return "\n".join(out) + "\n"


def bash(h):
    cases = "".join(f"    {'|'.join(o.names)}) COMPREPLY=($(compgen -W '{' '.join(o.words)}' -- \"$word\")); return ;;\n"
                    for o in h.options if o.words)
    return (f"# Completions of {h.name} for bash.\n_{h.name}() {{\n  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}}\n"
            f"  case $before in\n{cases}    *) ;;\n  esac\n  if [[ $word == -* ]]; then\n"
            f"    COMPREPLY=($(compgen -W '{' '.join(h.names())}' -- \"$word\"))\n  else\n    COMPREPLY=($(compgen -f -- \"$word\"))\n  fi\n}}\n"
            f"complete -o filenames -F _{h.name} {h.name}\n")


def zsh(h):
    rows = []
    for o in h.options:
        text = re.sub(r"([\[\]:\\])", r"\\\1", o.text).replace("'", "'\\''")
        action = f":{o.value.lower()}:({' '.join(o.words)})" if o.words else f":{o.value.lower().replace(':', '')}:_files" if o.value else ""
        rows += [f"  '*{name}[{text}]{action}' \\" for name in o.names]
    return f"#compdef {h.name}\n_arguments -s \\\n" + "\n".join(rows) + "\n  '*:file:_files'\n"


def fish(h):
    out = [f"# Completions of {h.name} for fish."]
    for o in h.options:
        names = " ".join(f"-l {n[2:]}" if n.startswith("--") else f"-s {n[1:]}" for n in o.names)
        text = o.text.replace("\\", "\\\\").replace("'", "\\'")
        value = f" -x -a '{' '.join(o.words)}'" if o.words else " -r" if o.value else ""
        out.append(f"complete -c {h.name} {names}{value} -d '{text}'")
    return "\n".join(out) + "\n"


def main():
    bin_folder, out = os.path.abspath(sys.argv[1]), sys.argv[2]
    for name in TOOLS:
        if not os.path.exists(os.path.join(bin_folder, name)):
            continue
        h = Help(bin_folder, name)
        for path, text in ((f"man1/{name}.1", man(h)), (f"bash/{name}", bash(h)), (f"zsh/_{name}", zsh(h)), (f"fish/{name}.fish", fish(h))):
            target = os.path.join(out, path)
            os.makedirs(os.path.dirname(target), exist_ok=True)
            with open(target, "w", encoding="utf-8") as f:
                f.write(text)


if __name__ == "__main__":
    main()
