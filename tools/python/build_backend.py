# SPDX-License-Identifier: GPL-3.0-or-later
"""PEP 517 backend: configures with CMake, builds the module, packs it. Needs no package from anywhere.

PADDER_BUILD_DIR in the environment names a build folder to use (and keep) instead of build/python.
"""
import base64
import hashlib
import os
import pathlib
import re
import subprocess
import sys
import sysconfig
import zipfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def _field(name):  # of pyproject.toml: Python 3.9 has no reader for it
    text = (ROOT / "pyproject.toml").read_text()
    return re.search(rf'^{name} = "(.*)"$', text, re.MULTILINE).group(1)


def _version():  # stands once, in project() of CMakeLists.txt
    text = (ROOT / "CMakeLists.txt").read_text()
    return re.search(r"^project\(padder VERSION (\d+\.\d+\.\d+)", text, re.MULTILINE).group(1)


def _metadata():
    return (
        f"Metadata-Version: 2.1\nName: padder\nVersion: {_version()}\nSummary: {_field('description')}\n"
        f"Requires-Python: {_field('requires-python')}\nRequires-Dist: numpy\n"
    )


def _tag():
    abi = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    return f"{abi}-{abi}-{re.sub('[^a-zA-Z0-9]', '_', sysconfig.get_platform())}"


def _build():
    given = os.environ.get("PADDER_BUILD_DIR")
    folder = pathlib.Path(given) if given else ROOT / "build" / "python"
    if not given or not (folder / "CMakeCache.txt").exists():
        subprocess.run(
            ["cmake", "-S", ROOT, "-B", folder, "-DCMAKE_BUILD_TYPE=Release", "-DPADDER_TESTS=OFF",
             "-DPADDER_PYTHON_MODULE=ON", f"-DPython_EXECUTABLE={sys.executable}"], check=True)
    subprocess.run(["cmake", "--build", folder, "--target", "padder_python", "--parallel", str(os.cpu_count() or 1)], check=True)
    return folder / "python" / "padder"


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    info = f"padder-{_version()}.dist-info"
    name = f"padder-{_version()}-{_tag()}.whl"
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    files = {}
    for file in sorted(_build().iterdir()):
        if file.suffix in (".py", ".pyi", ".typed") or file.name == f"_core{suffix}":
            files[f"padder/{file.name}"] = file.read_bytes()
    if f"padder/_core{suffix}" not in files:
        raise SystemExit(f"the build folder is of another Python than {sys.executable}: choose another PADDER_BUILD_DIR")
    files[f"{info}/METADATA"] = _metadata().encode()
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: padder\nRoot-Is-Purelib: false\nTag: {_tag()}\n".encode()
    files[f"{info}/licenses/LICENSE"] = (ROOT / "LICENSE").read_bytes()
    record = ""
    for path, data in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        record += f"{path},sha256={digest},{len(data)}\n"
    files[f"{info}/RECORD"] = (record + f"{info}/RECORD,,\n").encode()
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, data in files.items():
            wheel.writestr(path, data)
    return name


def build_sdist(sdist_directory, config_settings=None):
    raise NotImplementedError("install from a checkout: pip install .")
