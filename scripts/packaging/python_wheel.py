# SPDX-License-Identifier: Apache-2.0
"""The build back end of pyproject.toml (PEP 517): the Python package as a wheel, by cmake alone."""

import base64
import hashlib
import os
import pathlib
import re
import subprocess
import sys
import sysconfig
import tempfile
import time
import zipfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def _version():
    return re.search(r"project\(sonocase VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text())[1]


def _tag():
    """Of one version of Python, since pybind11 looks into its structures and has no stable ABI, and of Linux in
    general rather than of a manylinux, since the module links libraries that Debian brings."""
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    return f"{python}-{python}-{re.sub('[-.]', '_', sysconfig.get_platform())}"


def _moment():
    """The commit's time, or SOURCE_DATE_EPOCH, as an archive notes it: the same commit gives the same wheel."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH") or subprocess.run(
        ["git", "-C", ROOT, "log", "-1", "--format=%ct"], capture_output=True, text=True).stdout
    return time.gmtime(int(epoch) if epoch.strip() else 315532800)[:6]  # without a clone: 1980, the first that a zip knows


def _built(prefix, build):
    """Builds and installs the package below `prefix`; `build`: a build folder that exists, or None. Returns its folder."""
    if build is None:
        build = ROOT / "build" / f"wheel-{_tag()}"
        off = [f"-DSONOCASE_{part}=OFF" for part in ("PIPELINE", "TESTS", "BENCH")]
        subprocess.run(["cmake", "-S", ROOT, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                        f"-DPython_EXECUTABLE={sys.executable}", "-DSONOCASE_PYTHON_FOLDER=.",
                        "-DSONOCASE_PYTHON=ON", *off],
                       check=True)
    elif not pathlib.Path(build, "CMakeCache.txt").is_file():
        raise SystemExit(f"{build}: no CMakeCache.txt; give the folder of a configured build")
    subprocess.run(["cmake", "--build", build, "--target", "sonocase_python"], check=True)
    subprocess.run(["cmake", "--install", build, "--component", "python", "--prefix", prefix,
                    "--strip"], check=True)
    modules = list(pathlib.Path(prefix).rglob("sonocase/_core.*"))
    if len(modules) != 1 or f"cpython-{sys.version_info.major}{sys.version_info.minor}" not in modules[0].name:
        raise SystemExit(f"{build}: holds {[m.name for m in modules]}; expected a module for this Python")
    return modules[0].parent


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """config_settings: `build`, the folder of a build to take the module from instead of a new one."""
    version, tag = _version(), _tag()
    info = f"sonocase-{version}.dist-info"
    files = {
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: sonocase\nRoot-Is-Purelib: false\n"
                         f"Tag: {tag}\n",
        f"{info}/LICENSE": (ROOT / "LICENSE").read_text(),
    }
    name = f"sonocase-{version}-{tag}.whl"
    with tempfile.TemporaryDirectory() as prefix:
        package = _built(prefix, (config_settings or {}).get("build"))
        files[f"{info}/METADATA"] = (
            f"Metadata-Version: 2.1\nName: sonocase\nVersion: {version}\n"
            "Summary: Ultrasound frames, labels and scores of case bundles\n"
            "License: Apache-2.0\nRequires-Python: >=3.9\n"
            "Provides-Extra: data\nRequires-Dist: numpy>=1.24; extra == \"data\"\n")
        for path in sorted(package.rglob("*")):
            if path.is_file():
                files[str(path.relative_to(package.parent))] = path.read_bytes()
        record = ""
        with zipfile.ZipFile(pathlib.Path(wheel_directory, name), "w", zipfile.ZIP_DEFLATED) as wheel:
            moment = _moment()

            def add(path, content):
                entry = zipfile.ZipInfo(path, moment)
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o100644 << 16
                wheel.writestr(entry, content)

            for path, content in files.items():
                content = content.encode() if isinstance(content, str) else content
                digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode().rstrip("=")
                record += f"{path},sha256={digest},{len(content)}\n"
                add(path, content)
            add(f"{info}/RECORD", record + f"{info}/RECORD,,\n")
    return name


def build_sdist(sdist_directory, config_settings=None):
    raise NotImplementedError("sonocase is installed from a checkout: pip install .")
