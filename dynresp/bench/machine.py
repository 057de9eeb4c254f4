"""Describe the machine and the versions that a benchmark ran on."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path


def describe_machine(packages: Sequence[str] = ("numpy", "numba", "mujoco")) -> dict[str, object]:
    """Processor, cores this process may use, system, and versions of what was measured.

    Args:
        packages: Distributions to report; the version is None for those not installed.

    Returns:
        A dictionary that `json` can write.
    """
    return {
        "processor": _processor(),
        "cores": _usable_cores(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": {name: _version(name) for name in packages},
    }


def machine_line(machine: dict[str, object]) -> str:
    """`describe_machine` as one line for people."""
    versions = machine["versions"]
    shown = versions.items() if isinstance(versions, dict) else ()
    packages = ", ".join(f"{name} {version}" for name, version in shown)
    return (
        f"{machine['processor']}, {machine['cores']} cores, {machine['system']}, "
        f"Python {machine['python']}, {packages}"
    )


def _processor() -> str:
    """Name of the processor; Linux keeps the readable one in /proc/cpuinfo."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(errors="replace").splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name":
                return value.strip()
    return platform.processor() or platform.machine()


def _usable_cores() -> int:
    """Cores this process may run on, fewer than the machine's in a container."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
