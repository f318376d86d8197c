#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pads robots, hands each to the programs it is for, and prints a Markdown table of what became of them.

  tests/tools/robots/table.py LIST > docs/results/robots.md
  tests/tools/robots/table.py LIST --only panda,pr2 --poses 10000 -- --tolerance 1%

LIST has a robot on each line: its name, its URDF, xacro or MJCF (beside LIST unless absolute), and options of pad for it
alone. The words behind -- go to pad for all of them (default: --tolerance 1%). Nothing that pad writes is edited.

Consumers: MuJoCo (Debian's: by robot_audit, which compares every geom's place in 100 poses; npm's: loads and counts),
check_urdf of urdfdom, the USD readers three.js, TinyUSDZ and OpenUSD (where it is installed), and by rule: MoveIt's SRDF, cuRobo's
robot_cfg, XRDF and VAMP. robot_audit also compares spheres and exact meshes in --poses random poses by FCL. Exit 1 when anything was refused or differs.
"""
import argparse
import json
import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET

try:
    import yaml
except ImportError:
    yaml = None

ROOT = pathlib.Path(__file__).resolve().parents[3]


def find_bin():
    built = [b for b in (ROOT / "build").glob("*/bin") if (b / "pad").exists()]
    if not built:
        sys.exit("table.py: pad is not built: run tools/run pad --help once")
    return max(built, key=lambda b: (b / "pad").stat().st_mtime)


class Refused(Exception):
    pass


def want(truth, sentence):
    if not truth:
        raise Refused(sentence)


def run(command, **more):
    """Stdout and processor seconds."""
    before = os.times()
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more)
    after = os.times()
    work = after.children_user + after.children_system - before.children_user - before.children_system
    if done.returncode != 0:
        raise Refused(f"{pathlib.Path(command[0]).name}: {(done.stdout.strip() or done.stderr.strip())[-300:]}")
    return done.stdout, work


def pairs_known(pairs, links, where):
    seen = set()
    for a, b in pairs:
        want(a in links and b in links, f"{where} names {a} and {b}, and one of them is no link of the URDF")
        want(a != b and frozenset((a, b)) not in seen, f"{where} has the pair {a}, {b} twice")
        seen.add(frozenset((a, b)))
    return seen


class Files:
    """What pad wrote for one robot, looked at by the rules of its readers."""

    def __init__(self, folder, name, report):
        self.at = lambda ending: folder / (name + ending)
        urdf = ET.parse(self.at(".urdf")).getroot()
        self.name = urdf.get("name")
        self.links = {link.get("name"): link for link in urdf.findall("link")}
        self.joints = {j.get("name"): j for j in urdf.findall("joint")}
        self.counts = {link["link"]: link["spheres"] for link in report["links"]}
        for link, count in self.counts.items():
            want(len(self.links[link].findall("collision")) == count, f"the URDF's link {link} has not {count} spheres")

    def check_urdf(self, robot):
        if not shutil.which("check_urdf"):
            return None
        if robot.suffix == ".urdf":
            try:
                run(["check_urdf", str(robot)])
            except Refused:  # the robot itself is none for it
                return None
        run(["check_urdf", str(self.at(".urdf"))])
        return True

    def srdf(self):
        """MoveIt: the robot's name is that of the URDF; links exist; no pair twice; a sphere has a centre and a radius."""
        root = ET.parse(self.at(".srdf")).getroot()
        want(root.tag == "robot" and root.get("name") == self.name, "the SRDF's robot has another name than the URDF's")
        found = {}
        for link in root.findall("link_sphere_approximation"):
            want(all(len(s.get("center").split()) == 3 and float(s.get("radius")) > 0 for s in link.findall("sphere")),
                 "the SRDF has a sphere without a centre or radius")
            found[link.get("link")] = len(link.findall("sphere"))
        want(found == self.counts, "the SRDF has other spheres than the report")
        self.apart = pairs_known([(d.get("link1"), d.get("link2")) for d in root.findall("disable_collisions")], self.links, "the SRDF")
        return True

    def vamp(self):
        """VAMP's generator, cricket, takes a URDF whose collision shapes are all spheres, and the pairs of the SRDF."""
        want(all(shape.find("geometry/sphere") is not None for link in self.links.values() for shape in link.findall("collision")),
             "the URDF has a collision shape that is no sphere")
        return True

    def moved(self, names, where):
        for name in names:
            joint = self.joints.get(name)
            want(joint is not None and joint.get("type") in ("revolute", "continuous", "prismatic") and joint.find("mimic") is None,
                 f"{where} plans with the joint {name}, which cannot be planned")
        return len(names)

    def ignored(self, table, where):
        want(pairs_known([(a, b) for a, others in table.items() for b in others], self.links, where) == self.apart,
             f"{where} keeps other pairs apart than the SRDF")

    def curobo(self):
        if yaml is None:
            return None
        config = yaml.safe_load(self.at(".yaml").read_text())["robot_cfg"]["kinematics"]
        want({k: len(v) for k, v in config["collision_spheres"].items()} == self.counts, "cuRobo's file has other spheres")
        want(sorted(config["collision_link_names"]) == sorted(self.counts), "cuRobo's collision_link_names are others")
        want(config["base_link"] in self.links and all(t in self.links for t in config["tool_frames"]),
             "cuRobo's base_link or a tool_frame is no link")
        want(config["format_version"] == 2.0, "cuRobo's file is none of 0.8")
        space = config["cspace"]
        count = self.moved(space["joint_names"], "cuRobo's file")
        want(all(len(space[k]) == count for k in ("default_joint_position", "null_space_weight", "cspace_distance_weight")),
             "a list of cuRobo's cspace has another length than joint_names")
        self.ignored(config["self_collision_ignore"], "cuRobo's file")
        return True

    def xrdf(self):
        if yaml is None:
            return None
        file = yaml.safe_load(self.at(".xrdf").read_text())
        want(file["format"] == "xrdf" and file["format_version"] == 1.0, "the XRDF has no format")
        count = self.moved(file["cspace"]["joint_names"], "the XRDF")
        want(len(file["cspace"]["acceleration_limits"]) == len(file["cspace"]["jerk_limits"]) == count, "the XRDF's limits")
        want(all(t in self.links for t in file["tool_frames"]), "the XRDF's tool is no link")
        want(set(file["default_joint_positions"]) == set(file["cspace"]["joint_names"]), "the XRDF's defaults are of other joints")
        spheres = file["geometry"][file["collision"]["geometry"]]["spheres"]
        want({k: len(v) for k, v in spheres.items()} == self.counts, "the XRDF has other spheres")
        self.ignored(file["self_collision"]["ignore"], "the XRDF")
        return True


def by_npm(files, binaries, spheres):
    """three.js and TinyUSDZ read the USD, and npm's MuJoCo the MJCF."""
    script = pathlib.Path(__file__).with_name("consumers.mjs")
    if not shutil.which("node") or not (binaries / "../page/work/node_modules/tinyusdz").exists():
        return None
    run(["node", str(script), str(binaries), str(files.at(".usda")), str(files.at(".xml")), str(spheres)])
    return True


def by_openusd(files, binaries):
    """OpenUSD and MuJoCo agree on every sphere, mass, joint and pair."""
    if not (binaries / "openusd_check").exists():
        return None
    run([str(binaries / "openusd_check"), str(files.at(".usda")), str(files.at(".xml"))])
    return True


class Table:
    def __init__(self, arguments, words):
        self.arguments, self.words = arguments, words
        self.bin = pathlib.Path(arguments.bin).resolve() if arguments.bin else find_bin()
        self.bad = 0

    def audit(self, robot, options, files, report):
        """FCL on the exact meshes, and MuJoCo on the MJCF."""
        if not (self.bin / "robot_audit").exists():
            return None
        (files.at(".json")).write_text(json.dumps(report))
        more = []
        for k, word in enumerate(options):
            more += [word] if word == "--visual" else [word, options[k + 1]] if word in ("--package-path", "--xacro") else []
        out, *_ = run([str(self.bin / "robot_audit"), str(robot), str(files.at(".json")), str(files.at(".urdf")), str(files.at(".xml")),
                       str(self.arguments.poses), "1", *more], cwd=files.at("").parent)  # MuJoCo may write a log
        return json.loads(out)

    def row(self, name, robot, options, folder):
        outputs = [word for ending in (".urdf", ".xml", ".yaml", ".xrdf", ".srdf", ".usda") for word in ("-o", str(folder / (name + ending)))]
        out, work = run([str(self.bin / "pad"), str(robot), *options, *outputs, "--json", *self.words])
        report = json.loads(out)
        padded = [link for link in report["links"] if not link["kept"]]
        certified = sum(link["accuracy"]["certified"] for link in padded)
        worst = max((max(link["accuracy"]["protrusion_bound"], link["accuracy"]["gap_bound"]) for link in padded), default=0)
        files = Files(folder, name, report)
        done = {"urdfdom": files.check_urdf(robot), "SRDF": files.srdf(), "cuRobo": files.curobo(), "XRDF": files.xrdf(), "VAMP": files.vamp(),
                "npm": by_npm(files, self.bin, report["spheres"]), "OpenUSD": by_openusd(files, self.bin)}
        told = self.audit(robot, options, files, report)
        accepted = [k for k, v in done.items() if v]
        if told and told["mujoco"]:
            accepted.append(f"MuJoCo {told['mujoco']['version']}")
        if told:
            want(told["both_touch"] or not self.arguments.touching, "no two links touched in any pose: nothing was compared")
            differ = f"{told['both_touch']:,} | {told['only_spheres']:,} | {told['only_meshes']:,} | {told['patched']:,} | {told['faults']:,}"
        else:
            differ = " | | | |"
        print(f"| {name} | {len(report['links'])} | {report['spheres']:,} | {certified} of {len(padded)} | {1000 * worst:.1f} | {work:.0f} | "
              f"{', '.join(accepted)} | {differ} |", flush=True)

    def print(self, robots):
        shown = " ".join(["tests/tools/robots/table.py", os.path.relpath(self.arguments.list), "--poses", str(self.arguments.poses), "--", *self.words])
        print(f"Printed by `{shown}`.\n")
        print("| robot | links with shapes | spheres | certified | worst error, mm | CPU s | accepted by | both touch | only spheres | only meshes | holes | faults |")
        print("| --- | ---: | ---: | ---: | ---: | ---: | --- | ---: | ---: | ---: | ---: | ---: |", flush=True)
        for name, robot, options in robots:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    self.row(name, robot, options, pathlib.Path(folder))
                except Refused as what:
                    self.bad += 1
                    sentence = str(what).replace("|", "\\|").replace("\n", " ").replace(str(robot), robot.name)
                    print(f"| {name} | | | | | | **{sentence}** | | | | | |", flush=True)
        print(f"\n{len(robots) - self.bad} of {len(robots)} robots without a fault.")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("list", help="file with a robot on each line")
    parser.add_argument("--only", help="names of robots, with commas between them")
    parser.add_argument("--poses", type=int, default=10000, help="random poses for FCL (default: 10000)")
    parser.add_argument("--touching", action="store_true", help="a robot whose links never touch is a fault")
    parser.add_argument("--bin", help="folder with pad and robot_audit (default: the newest build)")
    words = sys.argv[1:]
    cut = words.index("--") if "--" in words else len(words)
    arguments = parser.parse_args(words[:cut])
    folder = pathlib.Path(arguments.list).resolve().parent
    robots = []
    for line in pathlib.Path(arguments.list).read_text().splitlines():
        entry = shlex.split(line, comments=True)
        if entry and (not arguments.only or entry[0] in arguments.only.split(",")):
            paths = [str(folder / w) if k and entry[1 + k] == "--package-path" else w for k, w in enumerate(entry[2:])]
            robots.append((entry[0], folder / entry[1], paths))
    table = Table(arguments, words[cut + 1:] or ["--tolerance", "1%"])
    table.print(robots)
    return 1 if table.bad else 0


if __name__ == "__main__":
    sys.exit(main())
