"""Keep the built pages by version: copies docs/_build/html to docs/_build/versions/VERSION, and lists the versions there."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def keep(built: Path, versions: Path, version: str) -> list[str]:
    """Put the pages into a folder of their version, and write a page that lists all versions and leads to the newest.

    Returns
    -------
    list of str
        The versions, newest first.
    """
    target = versions / version
    if target.exists():
        shutil.rmtree(target)
    shutil.copytree(built, target)
    found = sorted((d.name for d in versions.iterdir() if (d / "index.html").exists()), key=_order, reverse=True)
    links = "".join(f'<li><a href="{name}/index.html">{name}</a></li>' for name in found)
    (versions / "index.html").write_text(
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>gearlib</title>'
        f'<meta http-equiv="refresh" content="3; url={found[0]}/index.html"></head>'
        f"<body><p>Versions of these pages, newest first:</p><ul>{links}</ul></body></html>\n",
        encoding="utf-8",
    )
    return found


def _order(name: str) -> tuple[list[int], bool, str]:
    """Versions by their numbers; one with letters, such as 1.0rc1, before that without."""
    numbers = re.match(r"\d+(\.\d+)*", name)
    return [int(n) for n in numbers[0].split(".")] if numbers else [], bool(re.fullmatch(r"[\d.]+", name)), name


if __name__ == "__main__":
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    built = ROOT / "docs" / "_build"
    print(*keep(built / "html", built / "versions", project["version"]), sep="\n")
