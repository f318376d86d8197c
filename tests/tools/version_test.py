# SPDX-License-Identifier: MIT
"""version_test.py BIN VERSION: the version stands once, in project() of CMakeLists.txt, and everything else tells it.

BIN is the folder of the programs, VERSION what CMake read. A Python package, the programs and the compiled module must agree.
"""
import importlib.util
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
failures = []


def expect(what, found, wanted):
    if found != wanted:
        failures.append(f"{what}: {found!r} instead of {wanted!r}")


def main():
    folder, version = pathlib.Path(sys.argv[1]), sys.argv[2]
    spec = importlib.util.spec_from_file_location("build_backend", ROOT / "tools/python/build_backend.py")
    backend = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(backend)
    expect("the version of the Python package", backend._version(), version)
    expect("its metadata", [line for line in backend._metadata().splitlines() if line.startswith("Version")], [f"Version: {version}"])
    project = (ROOT / "pyproject.toml").read_text()
    if version in project or 'dynamic = ["version"]' not in project:
        failures.append("pyproject.toml names a version of its own: leave it to CMakeLists.txt")
    for name in ("pad", "detect", "settle", "preview", "bench", "make_assets"):
        if (folder / name).exists():
            said = subprocess.run([folder / name, "--version"], check=True, capture_output=True, text=True).stdout.strip()
            expect(f"{name} --version", said, f"{name} (padder) {version}")
    module = folder.parent / "python"
    if list(module.glob("padder/_core*")):
        code = f"import sys; sys.path.insert(0, {str(module)!r}); import padder; print(padder.__version__)"
        run = subprocess.run([sys.argv[3] if len(sys.argv) > 3 else sys.executable, "-c", code], check=True, capture_output=True, text=True)
        expect("padder.__version__", run.stdout.strip(), version)
    print("\n".join(failures) or f"{version} everywhere")
    sys.exit(1 if failures else 0)


main()
