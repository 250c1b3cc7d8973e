"""The pictures of docs/gallery.md, drawn by the code blocks of the page, and of the start page.

    python scripts/gallery.py

The blocks run as they do in the tests, and the pictures that they draw go to docs/figures/gallery.
The screenshot of the start page is the report of its first study, in a headless Chromium if there
is one.
"""

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs" / "figures" / "gallery"
CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
REPORT = "report.png"
MAX_SIZE = 150_000  # bytes of a picture: a page loads fast
COLOURS = 256  # of a picture, which takes a third of the bytes


def run_blocks(folder: Path) -> None:
    """Run the code blocks of the gallery in a folder."""
    spec = importlib.util.spec_from_file_location("test_docs", ROOT / "tests" / "test_docs.py")
    tests = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tests)
    tests.run_page(ROOT / "docs" / "gallery.md", folder, slow=False)


def screenshot(folder: Path) -> None:
    """Photograph the top of the report of the first study of the gallery."""
    browser = next(filter(None, map(shutil.which, CHROMIUM)), None)
    if browser is None:
        print("no Chromium: the screenshot of the report is left as it is")
        return
    gfmd = [sys.executable, "-m", "gfmd_cli"]
    subprocess.run([*gfmd, "report", "afm.h5", "-o", "report.html"], cwd=folder, check=True)
    options = ["--headless=new", "--no-sandbox", "--hide-scrollbars", "--window-size=1000,1250"]
    page = (folder / "report.html").as_uri()
    shot = f"--screenshot={folder / REPORT}"
    subprocess.run([browser, *options, shot, page], check=True, capture_output=True)


def main() -> None:
    os.environ["MPLBACKEND"] = "agg"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.chdir(folder)
        run_blocks(folder)
        screenshot(folder)
        FIGURES.mkdir(parents=True, exist_ok=True)
        for picture in sorted(folder.glob("*.png")):
            copy = FIGURES / picture.name
            Image.open(picture).convert("RGB").quantize(COLOURS).save(copy, optimize=True)
            size = copy.stat().st_size
            print(f"{picture.name}: {size / 1000:.0f} kB")
            assert size <= MAX_SIZE, f"more than {MAX_SIZE} bytes"
        os.chdir(ROOT)


if __name__ == "__main__":
    main()
