#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""page_bench.py BIN CLUSTER [SPHERES]: how long a page of a million spheres takes in a headless browser, drawn in software.

Makes a pile of copies of the cluster, at least SPHERES (1000000) in all, opens its page and prints one line for each figure.
"""
import json
import math
import os
import subprocess
import sys
import tempfile
import time

import browser


def used(before, after):
    spent = {k: after[k] - before.get(k, 0) for k in after}
    return f"   processor {sum(spent.values()):.2f} s: " + ", ".join(f"{k} {v:.2f}" for k, v in spent.items() if v >= 0.1)


def main():
    if browser.absent():
        sys.exit("page_bench: " + browser.absent())
    bin_folder, cluster = sys.argv[1:3]
    wanted = int(sys.argv[3]) if len(sys.argv) > 3 else 1000000
    with open(cluster) as f:
        copies = math.ceil(wanted / json.load(f)["spheres"]["count"])
    with tempfile.TemporaryDirectory() as folder:
        page = os.path.join(folder, "page.html")
        report = json.loads(subprocess.run([os.path.join(bin_folder, "preview"), cluster, "--copies", str(copies), "-o", page, "--json"],
                                           check=True, capture_output=True, text=True).stdout)
        b = browser.Browser(1280, 720)
        try:
            cpu = b.cpu()
            began = time.monotonic()
            b.open(page)
            b.wait("window.padder && padder.state().frames > 0 && padder.state().drawn === padder.state().spheres")
            opened = time.monotonic() - began
            opened_cpu = used(cpu, b.cpu())
            cpu = b.cpu()
            began = time.monotonic()
            b.click(600, 360)
            b.wait("!document.querySelector('#picked-panel').hidden")
            answered = time.monotonic() - began
            answered_cpu = used(cpu, b.cpu())
            picked = b.run("return padder.state().picked")
            print(f"processors                 {os.cpu_count()}, load {os.getloadavg()[0]:.1f}")
            print(f"spheres                    {report['spheres']}")
            print(f"bodies                     {report['bodies']}")
            print(f"page                       {report['bytes'] / 1e6:.1f} MB, written in {report['seconds']:.2f} s")
            print(f"open to all spheres shown  {opened:.2f} s" + opened_cpu)
            print(f"click to answer            {answered:.2f} s (sphere {picked})" + answered_cpu, flush=True)
            times = []
            for _ in range(30):
                began = time.monotonic()
                b.keys("\ue012")
                b.wait("!padder.state().busy")
                times.append(time.monotonic() - began)
            drawn = b.run("return padder.state().drawn")
            print(f"frame while turning        {1000 * sorted(times[15:])[7]:.0f} ms (median; {drawn} spheres drawn)")
            assert b.log() == [], "the console must stay silent"
        finally:
            b.close()


main()
