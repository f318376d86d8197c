# SPDX-License-Identifier: GPL-3.0-or-later
"""What pip asks of the build backend: metadata without a compiler, an sdist that builds, wheels with programs, editable installs."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile

import pytest

SOURCE = pathlib.Path(os.environ.get("PADDER_SOURCE_DIR", pathlib.Path(__file__).resolve().parents[2]))


def backend(folder, call, source=SOURCE, **env):
    """What the backend answers to `call`, in a process of its own and in `folder`, as pip does it."""
    code = f"import sys; sys.path.insert(0, {str(source / 'tools/python')!r}); import build_backend; print('ANSWER', build_backend.{call})"
    ran = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, env={**os.environ, **env})
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout.split("ANSWER ")[1].strip()


def test_metadata_needs_no_compiler(tmp_path):
    info = backend(tmp_path, "prepare_metadata_for_build_wheel('.')", PATH="/nowhere")
    text = (tmp_path / info / "METADATA").read_text()
    assert "\nName: padder\n" in text and "\nRequires-Dist: numpy\n" in text and "# padder" in text


def test_an_sdist_holds_what_a_build_needs(tmp_path):
    name = backend(tmp_path, "build_sdist('.')")
    with tarfile.open(tmp_path / name) as archive:
        archive.extractall(tmp_path)
    top = tmp_path / name.removesuffix(".tar.gz")
    assert "Name: padder" in (top / "PKG-INFO").read_text()
    # It can be made again from itself, with the same files.
    again = backend(tmp_path / top.name, "build_sdist('..')", source=top)
    with tarfile.open(tmp_path / again) as archive:
        assert {m.name for m in archive if m.isfile()} == {str(p.relative_to(tmp_path)) for p in top.rglob("*") if p.is_file() and p.suffix != ".pyc"}
    if shutil.which("cmake"):
        ran = subprocess.run(["cmake", "-S", top, "-B", tmp_path / "build", "-DPADDER_TESTS=OFF", "-DPADDER_PYTHON_MODULE=ON", "-DPADDER_CUDA=OFF", "-DPADDER_MPI=OFF",
                              f"-DPython_EXECUTABLE={sys.executable}"], capture_output=True, text=True)
        assert ran.returncode == 0, ran.stdout + ran.stderr


@pytest.mark.skipif("PADDER_BUILD_DIR" not in os.environ, reason="nothing is built")
def test_an_editable_wheel_brings_a_path(tmp_path):
    with zipfile.ZipFile(tmp_path / backend(tmp_path, "build_editable('.')")) as wheel:
        path = wheel.read("padder-editable.pth").decode().strip()
    assert (pathlib.Path(path) / "padder" / "__init__.py").resolve() == (SOURCE / "tools/python/padder/__init__.py").resolve()


@pytest.mark.skipif("PADDER_BUILD_DIR" not in os.environ or not shutil.which("patchelf"), reason="nothing is built, or patchelf is not installed")
def test_a_wheel_can_carry_its_libraries(tmp_path):
    with zipfile.ZipFile(tmp_path / backend(tmp_path, "build_wheel('.', {'libraries': 'carried'})")) as wheel:
        names = wheel.namelist()
        environment = tmp_path / "environment"  # laid out as pip lays it out
        packages = environment / f"lib/python{sys.version_info[0]}.{sys.version_info[1]}/site-packages"
        wheel.extractall(packages)
    shutil.move(next(packages.glob("*.data/scripts")), environment / "bin")
    files = [*environment.glob("bin/*"), *packages.glob("padder/_core*"), *packages.glob("padder.libs/*")]
    assert len(files) > 20 and not any(name.startswith("padder.libs/libc.so") for name in names)
    for file in files:
        file.chmod(0o755)
        listed = subprocess.run(["ldd", file], capture_output=True, text=True, check=True).stdout
        for name, path in re.findall(r"^\s*(\S+) => (\S+)", listed, re.MULTILINE):
            assert str(packages) in os.path.realpath(path) or re.match(r"lib(c|m|dl|rt|pthread|resolv|util)\.so", name), (file.name, name, path)
    ran = subprocess.run([environment / "bin" / "pad", "--version"], capture_output=True, text=True)
    assert ran.returncode == 0 and "padder" in ran.stdout, ran.stderr
    ran = subprocess.run([sys.executable, "-c", "import padder; print(padder.__version__)"], capture_output=True, text=True,
                         env={**os.environ, "PYTHONPATH": str(packages)})
    assert ran.returncode == 0, ran.stderr


@pytest.mark.skipif("PADDER_BUILD_DIR" not in os.environ, reason="nothing is built")
def test_pip_installs_a_checkout(tmp_path):
    if subprocess.run([sys.executable, "-m", "pip", "--version"], capture_output=True).returncode:
        pytest.skip("pip is not installed")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", tmp_path, SOURCE]
    ran = subprocess.run(command, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    code = "import padder; print(padder.__file__, padder.__version__)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(tmp_path)})
    assert ran.stdout.startswith(str(tmp_path)), ran.stderr
    info = f"padder-{ran.stdout.split()[-1]}.dist-info/"
    assert subprocess.run([tmp_path / "bin" / "pad", "--version"], capture_output=True, text=True).stdout.startswith("pad (padder)")
    names = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*")}
    assert names >= {"bin/detect", "bin/preview", "padder/__init__.py", "padder/py.typed", info + "METADATA", info + "RECORD"}, names
