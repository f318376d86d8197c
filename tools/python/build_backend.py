# SPDX-License-Identifier: GPL-3.0-or-later
"""PEP 517 and 660 backend: configures with CMake, builds the module and the programs, packs them. Needs no package from anywhere.

PADDER_BUILD_DIR in the environment names a build folder to use (and keep) instead of build/python.
"""
import base64
import hashlib
import io
import os
import pathlib
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import zipfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAMS = ("pad", "detect", "preview")  # what pip puts beside python


def _field(name):  # of pyproject.toml: Python 3.9 has no reader for it
    text = (ROOT / "pyproject.toml").read_text()
    return re.search(rf'^{name} = "(.*)"$', text, re.MULTILINE).group(1)


def _version():  # stands once, in project() of CMakeLists.txt
    text = (ROOT / "CMakeLists.txt").read_text()
    return re.search(r"^project\(padder VERSION (\d+\.\d+\.\d+)", text, re.MULTILINE).group(1)


def _metadata():
    return (
        f"Metadata-Version: 2.1\nName: padder\nVersion: {_version()}\nSummary: {_field('description')}\n"
        "License: MIT AND GPL-3.0-or-later\nClassifier: Programming Language :: C++\nClassifier: Topic :: Scientific/Engineering\n"
        f"Requires-Python: {_field('requires-python')}\nRequires-Dist: numpy\nDescription-Content-Type: text/markdown\n\n"
        + (ROOT / "README.md").read_text()
    )


def _tag():
    abi = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    return f"{abi}-{abi}-{re.sub('[^a-zA-Z0-9]', '_', sysconfig.get_platform())}"


def _info():  # what tells pip of the package, by file
    return {
        "METADATA": _metadata().encode(),
        "WHEEL": f"Wheel-Version: 1.0\nGenerator: padder\nRoot-Is-Purelib: false\nTag: {_tag()}\n".encode(),
        "licenses/LICENSE": (ROOT / "LICENSE").read_bytes(),
    }


def _build():
    """The build folder, with the module for this Python and the programs in it.

    A build that is made once compiles up to eight sources as one (CMAKE_UNITY_BUILD): that takes 8.5 minutes of processor time
    instead of 12."""
    given = os.environ.get("PADDER_BUILD_DIR")
    folder = pathlib.Path(given) if given else ROOT / "build" / "python"
    if not given or not (folder / "CMakeCache.txt").exists():
        subprocess.run(
            ["cmake", "-S", ROOT, "-B", folder, "-DCMAKE_BUILD_TYPE=Release", "-DPADDER_TESTS=OFF",
             "-DPADDER_PYTHON_MODULE=ON", "-DCMAKE_UNITY_BUILD=ON", "-DPADDER_MPI=OFF", f"-DPython_EXECUTABLE={sys.executable}"]
            + (["-G", "Ninja"] if shutil.which("ninja") else []), check=True)
    build = ["cmake", "--build", str(folder), "--parallel", str(os.cpu_count() or 1), "--target"]
    subprocess.run(build + ["padder_python", *PROGRAMS], check=True)
    # Pages need a template, which npm bundles. Without npm or a network everything but pages works.
    if not (folder / "page" / "page.html").exists() and shutil.which("npm"):
        subprocess.run(build + ["page"], check=False)
    if not (folder / "python" / "padder" / f"_core{sysconfig.get_config_var('EXT_SUFFIX')}").exists():
        raise SystemExit(f"the build folder is of another Python than {sys.executable}: choose another PADDER_BUILD_DIR")
    return folder


def _write_wheel(wheel_directory, files):
    info = f"padder-{_version()}.dist-info"
    name = f"padder-{_version()}-{_tag()}.whl"
    files = {**files, **{f"{info}/{file}": data for file, data in _info().items()}}
    record = ""
    for path, data in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        record += f"{path},sha256={digest},{len(data)}\n"
    files[f"{info}/RECORD"] = (record + f"{info}/RECORD,,\n").encode()
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, data in files.items():
            entry = zipfile.ZipInfo(path, (1980, 1, 1, 0, 0, 0))
            entry.external_attr = (0o100755 if "/scripts/" in path else 0o100644) << 16  # pip keeps what is executable so
            wheel.writestr(entry, data, zipfile.ZIP_DEFLATED)
    return name


def _programs(folder):
    """The programs and the template of their pages, where pip puts them: bin/ and share/padder/ of the environment."""
    data = f"padder-{_version()}.data"
    files = {f"{data}/scripts/{name}": (folder / "bin" / name).read_bytes() for name in PROGRAMS}
    page = folder / "page" / "page.html"
    if page.exists():
        files[f"{data}/data/share/padder/page.html"] = page.read_bytes()
    return files


def _with_libraries(files):
    """The files, changed so that they find their libraries in padder.libs/, and these libraries: all but the C library's own."""
    if not shutil.which("patchelf"):
        raise SystemExit("a wheel that carries its libraries needs patchelf: apt-get install patchelf")
    python = f"lib/python{sys.version_info[0]}.{sys.version_info[1]}"
    out = dict(files)
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / "copy"

        def carry(path, data, places):
            copy.write_bytes(data)
            listed = subprocess.run(["ldd", copy], capture_output=True, text=True, check=True).stdout
            subprocess.run(["patchelf", "--force-rpath", "--set-rpath", ":".join(f"$ORIGIN/{place}" for place in places), copy], check=True)
            out[path] = copy.read_bytes()
            for name, library in re.findall(r"^\s*(\S+) => (/\S+)", listed, re.MULTILINE):
                if not re.match(r"(libc|libm|libdl|librt|libpthread|libresolv|libutil)\.so", name) and f"padder.libs/{name}" not in out:
                    carry(f"padder.libs/{name}", pathlib.Path(library).read_bytes(), ["."])

        for path, data in files.items():
            if "/scripts/" in path:  # in bin/, beside the lib/ of the environment
                carry(path, data, [f"../{python}/{packages}/padder.libs" for packages in ("site-packages", "dist-packages")])
            elif path.startswith("padder/_core"):
                carry(path, data, ["../padder.libs"])
    return out


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    folder = _build()
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    files = {f"padder/{file.name}": file.read_bytes() for file in sorted((folder / "python" / "padder").iterdir())
             if file.suffix in (".py", ".pyi", ".typed") or file.name == f"_core{suffix}"}
    files.update(_programs(folder))
    libraries = (config_settings or {}).get("libraries", "system")
    if libraries not in ("system", "carried"):
        raise SystemExit(f"--config-settings libraries={libraries}: it is system (the default) or carried")
    return _write_wheel(wheel_directory, _with_libraries(files) if libraries == "carried" else files)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    """The module stays in the build folder, which links to the Python files of the checkout: a change of these is seen at once,
    one of the C++ sources after `cmake --build build/python`."""
    folder = _build()
    return _write_wheel(wheel_directory, {"padder-editable.pth": f"{folder / 'python'}\n".encode(), **_programs(folder)})


def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    """Without compiling: pip asks for the name, the version and what is required."""
    info = pathlib.Path(metadata_directory) / f"padder-{_version()}.dist-info"
    for file, data in _info().items():
        (info / file).parent.mkdir(parents=True, exist_ok=True)
        (info / file).write_bytes(data)
    return info.name


prepare_metadata_for_build_editable = prepare_metadata_for_build_wheel


def _sources():
    """The files of the checkout, or of an unpacked sdist."""
    if (ROOT / ".git").exists() and shutil.which("git"):
        listed = subprocess.run(["git", "-C", ROOT, "ls-files", "-z"], capture_output=True, check=True).stdout.decode()
        names = [name for name in listed.split("\0") if name]
    else:
        names = [str(path.relative_to(ROOT)) for path in ROOT.rglob("*") if path.is_file()]
    left_out = ("build/", "docs/results/", "tests/", "PKG-INFO")
    return sorted(name for name in names if not name.startswith(left_out) and (ROOT / name).is_file())


def build_sdist(sdist_directory, config_settings=None):
    top = f"padder-{_version()}"
    with tarfile.open(pathlib.Path(sdist_directory) / f"{top}.tar.gz", "w:gz") as archive:
        metadata = _metadata().encode()
        about = tarfile.TarInfo(f"{top}/PKG-INFO")
        about.size = len(metadata)
        archive.addfile(about, io.BytesIO(metadata))
        for name in _sources():
            archive.add(ROOT / name, f"{top}/{name}")
    return f"{top}.tar.gz"
