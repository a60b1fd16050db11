"""What gpu-report and gpu-train share: packing for a machine that has neither network nor Rust, and running there."""

import contextlib
import json
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import tarfile
import tempfile

from . import store

# Largest archive, bytes.
ARCHIVE_MAX = 60_000_000
LOADER = ["libvulkan1", "libegl1", "libglvnd0"]
NVIDIA_DRIVER = "/usr/local/nvidia/share/vulkan/icd.d/nvidia_icd.json"


class VisitError(Exception):
    """A message for the user, and the exit code."""

    def __init__(self, message, code=1):
        super().__init__(message)
        self.code = code


def output(command, **options):
    """What a command prints; raises `VisitError` if it fails."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    except FileNotFoundError:
        raise VisitError(f"{command[0]} is not installed", 2) from None
    if done.returncode != 0:
        raise VisitError(f"{' '.join(map(str, command))}: {done.stderr.strip()[-2000:]}")
    return done.stdout


def built(root, commands):
    """Runs cargo with each command's arguments; returns the path of the executable of each name."""
    if not (root / "Cargo.toml").is_file():
        raise VisitError("pack works in a checkout", 2)
    found = {}
    for name, arguments in commands.items():
        print(f"cargo {' '.join(arguments)}", file=sys.stderr)
        for message in map(json.loads, output(["cargo", *arguments, "--message-format=json"], cwd=root).splitlines()):
            if message.get("executable") and message["target"]["name"] == name:
                found[name] = pathlib.Path(message["executable"])
    return found


def loader(folder):
    """Unpacks Debian's Vulkan loader into `folder`, for machines that lack it; says so where there is no Debian."""
    if not shutil.which("apt-get") or not shutil.which("dpkg"):
        print("no Debian: the archive has no Vulkan loader, and the machine must have its own", file=sys.stderr)
        return
    with tempfile.TemporaryDirectory() as downloads:
        # apt's own user could not write into another's folder.
        os.chmod(downloads, 0o777)
        output(["apt-get", "download", *LOADER], cwd=downloads)
        for package in pathlib.Path(downloads).glob("*.deb"):
            output(["dpkg", "-x", package, folder])


@contextlib.contextmanager
def stage(name, root, programs, files):
    """A folder `name` with the programs, stripped, and the files of the checkout `root`, at the same places as there."""
    commit = output(["git", "rev-parse", "--short=7", "HEAD"], cwd=root).strip()
    changed = output(["git", "status", "--porcelain", "--", "src", "crates", "assets", "configs", "training", "Cargo.lock"], cwd=root).strip()
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary) / name
        folder.mkdir()
        for program, path in programs.items():
            shutil.copy(path, folder / program)
            output(["strip", folder / program])
        for file in [*files, "scripts/measuring/visit.py", "scripts/measuring/store.py"]:
            source, target = root / file, folder / file
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.is_dir():
                shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(source, target)
        made = {"commit": commit + ("+" if changed else ""), "glibc": platform.libc_ver()[1], "machine": platform.machine()}
        (folder / "packed.json").write_text(json.dumps(made))
        yield folder


def archive(folder, out, command):
    """Packs the folder; returns what to tell the user. `command` is what runs there."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with tarfile.open(out, "w:xz", preset=9) as file:
        file.add(folder, folder.name)
    size = out.stat().st_size
    if size > ARCHIVE_MAX:
        raise VisitError(f"{out} has {size} bytes, more than {ARCHIVE_MAX}")
    packed = json.loads((folder / "packed.json").read_text())
    return (
        f"{out}: {size / 1e6:.1f} MB, {packed['machine']}, glibc {packed['glibc']} or later\n"
        f"there: tar -xf {out.name} && cd {folder.name} && {command}"
    )


def environment(root, host=False, **extra):
    """Environment of the program in the unpacked archive `root`: the packed loader behind the machine's own, and the packed cache."""
    names = {**os.environ, "INSONIFY_CACHE": str(root / "cache"), "INSONIFY_BACKEND": "host" if host else "device"}
    if "libvulkan.so.1" not in subprocess.run(["/sbin/ldconfig", "-p"], capture_output=True, text=True, check=False).stdout:
        packed = [str(path.parent) for path in (root / "vulkan").rglob("libvulkan.so.1")]
        names["LD_LIBRARY_PATH"] = ":".join([*packed, *filter(None, [os.environ.get("LD_LIBRARY_PATH")])])
    # Containers have NVIDIA's driver where the loader does not look.
    if os.path.exists(NVIDIA_DRIVER):
        names.setdefault("VK_DRIVER_FILES", NVIDIA_DRIVER)
    names.setdefault("XDG_RUNTIME_DIR", tempfile.gettempdir())
    return {**names, **extra}


def machine():
    """Name of the machine: its GPUs by NVIDIA's tool, if it has any, processor and cores."""
    gpus = []
    if shutil.which("nvidia-smi"):
        asked = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
        gpus = subprocess.run(asked, capture_output=True, text=True, check=False).stdout.split("\n")
    return ", ".join([*filter(None, gpus), store.machine()["processor"], f"{os.cpu_count()} cores"])
