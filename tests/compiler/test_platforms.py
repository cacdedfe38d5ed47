"""The platform of the host, by the names that FMI gives platforms."""

from __future__ import annotations

import platform
import sys

import pytest

from gearlib.compiler.platforms import PLATFORMS, own_platform


@pytest.mark.parametrize(
    ("machine", "system", "name"),
    [
        ("x86_64", "linux", "x86_64-linux"), ("AMD64", "win32", "x86_64-windows"), ("arm64", "darwin", "aarch64-darwin"),
        ("aarch64", "linux", "aarch64-linux"), ("ARM64", "win32", "aarch64-windows"), ("x86_64", "darwin", "x86_64-darwin"),
        ("riscv64", "linux", "riscv64-linux"),
    ],
)  # fmt: skip
def test_names_of_platforms(machine: str, system: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "machine", lambda: machine)
    monkeypatch.setattr(sys, "platform", system)
    assert own_platform() == name
    assert (name in PLATFORMS) == (machine != "riscv64")
    assert name not in PLATFORMS or PLATFORMS[name].name == name
