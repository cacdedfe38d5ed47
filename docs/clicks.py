"""Clicks from the home page of the built pages to what eleven tasks need: `python docs/clicks.py`, after `make docs`.

Counted are links in the text of a page, not those of the navigation beside it. A task is reached where its page shows the call that does
it. With Chromium installed, pages are read as it renders them.
"""

from __future__ import annotations

import posixpath
import shutil
import subprocess
from collections.abc import Callable
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

BUILT = Path(__file__).parent / "_build" / "html"
MOST = 3
TASKS = {  # task: the page that tells how, and the call that it shows
    "model an own gearbox": ("own_gearbox.html", "gp.GearPair("),
    "write a component": ("components.html", "def equations(self)"),
    "read an error": ("errors.html", "SingularError"),
    "choose a method": ("solvers.html", "simulate(method="),
    "sweep": ("many_runs.html", "system.sweep("),
    "fit": ("fitting.html", "gl.fit("),
    "save": ("files.html", "gl.load_result("),
    "export an FMU": ("fmu.html", "export_fmu("),
    "draw the model": ("pictures.html", ".diagram("),
    "find resonances": ("linear_analysis.html", "gl.modes("),
    "size a clutch": ("gallery/clutch_sizing.html", "gp.Clutch("),
}


class Article(HTMLParser):
    """Text and links of the main part of a page.

    >>> page = Article('<a href="x.html">no</a><article role="main">ab<a href="y.html#part">yes</a></article>')
    >>> page.text, page.links
    ('abyes', {'y.html': 'yes'})
    """

    def __init__(self, html: str) -> None:
        super().__init__()
        self.depth, self.text, self.links = 0, "", dict[str, str]()
        self._link = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "article":
            self.depth += 1
        target = (dict(attrs).get("href") or "").partition("#")[0] if tag == "a" and self.depth else ""
        if target and "://" not in target:
            self._link = target
            self.links[target] = ""

    def handle_endtag(self, tag: str) -> None:
        self.depth -= tag == "article"
        if tag == "a":
            self._link = ""

    def handle_data(self, data: str) -> None:
        if self.depth:
            self.text += data
        if self._link:
            self.links[self._link] += data


def clicks(read: Callable[[str], Article], wanted: tuple[str, str], most: int = MOST) -> list[tuple[str, str]] | None:
    """Shortest way from index.html to a page, as (words of the link, page); None if it takes too many clicks.

    Parameters
    ----------
    read : callable
        The page of a name.
    wanted : tuple
        The page's name, and what its text must show.
    most : int
        Clicks.
    """
    ways: list[list[tuple[str, str]]] = [[]]
    seen = {"index.html"}
    while ways:
        way = ways.pop(0)
        here = way[-1][1] if way else "index.html"
        page = read(here)
        if here == wanted[0]:
            return way if wanted[1] in page.text else None
        for link, words in page.links.items() if len(way) < most else ():
            target = posixpath.normpath(posixpath.join(posixpath.dirname(here), link))
            if target.endswith(".html") and target not in seen:
                seen.add(target)
                ways.append([*way, (" ".join(words.split()), target)])
    return None


def reader(folder: Path) -> Callable[[str], Article]:
    """Read pages of a folder, as a browser renders them where there is one."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")

    @cache
    def read(name: str) -> Article:
        path = folder / name
        if not path.exists():
            return Article("")
        if browser is None:
            return Article(path.read_text(encoding="utf-8"))
        command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", path.as_uri()]
        return Article(subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout)

    return read


def main() -> None:
    read = reader(BUILT)
    ways = {task: clicks(read, wanted) for task, wanted in TASKS.items()}
    for task, way in ways.items():
        shown = " -> ".join(f"{words} ({page})" for words, page in way) if way else f"not within {MOST} clicks"
        print(f"{task:22} {len(way or ())}  {shown}")
    if missing := [task for task, way in ways.items() if way is None]:
        raise SystemExit(f"too many clicks from the home page: {', '.join(missing)}")


if __name__ == "__main__":
    main()
