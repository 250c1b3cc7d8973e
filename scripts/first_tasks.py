"""Processor seconds of the ten first questions of docs/tutorial.md, as a table.

    python scripts/first_tasks.py

The commands of the page run as they stand there, in an empty folder with configs/, twice; the
shorter time counts. The first run also compiles the kernels.
"""

import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from markdown_tables import print_head, print_row

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "tutorial.md"
RUNS = 2


def questions() -> dict[str, list[str]]:
    """The commands of each question, by its heading."""
    section = PAGE.read_text(encoding="utf-8").partition("## Ten first questions")[2]
    section = section.partition("\n## ")[0]
    parts = re.split(r"^### (.*)$", section, flags=re.MULTILINE)[1:]
    commands = (re.findall(r"^\$ gfmd (.*)$", part, flags=re.MULTILINE) for part in parts[1::2])
    return dict(zip(parts[::2], commands, strict=True))


def processor_seconds(commands: list[str], folder: Path) -> float:
    """Processor seconds of commands that run one after the other."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    for command in commands:
        words = [sys.executable, "-m", "gfmd_cli", *shlex.split(command)]
        subprocess.run(words, cwd=folder, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    seconds: dict[str, list[float]] = {}
    for _ in range(RUNS):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            shutil.copytree(ROOT / "configs", folder / "configs")
            for title, commands in questions().items():
                seconds.setdefault(title, []).append(processor_seconds(commands, folder))
    print_head("question", "commands", "processor seconds")
    for title, commands in questions().items():
        print_row(title, len(commands), f"{min(seconds[title]):.1f}")


if __name__ == "__main__":
    main()
