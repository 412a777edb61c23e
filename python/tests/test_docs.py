"""The blocks of docs/python.md run in order. They and those of docs/simulation.md pass type checkers, and their tests pass."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

DOCS = Path(__file__).parents[2] / "docs"


def blocks(page: Path) -> list[tuple[int, str]]:
    """The Python blocks of a page, each with the number of its first line."""
    text = page.read_text(encoding="utf-8")
    found = re.finditer(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    return [(text.count("\n", 0, block.start(1)) + 1, block.group(1)) for block in found]


def test_the_blocks_of_the_first_steps_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "first_steps"}
    page = DOCS / "python.md"
    for line, block in blocks(page):
        # The empty lines give a traceback the line of the page.
        exec(compile("\n" * (line - 1) + block, str(page), "exec"), names)
    assert len(blocks(page)) >= 8


@pytest.mark.parametrize("checker", ["mypy", "basedpyright"])
def test_a_strict_type_checker_accepts_the_blocks_of_the_pages(checker: str, tmp_path: Path) -> None:
    pytest.importorskip(checker)
    for page in ["python", "simulation"]:
        text = "\n".join(block for _, block in blocks(DOCS / f"{page}.md"))
        (tmp_path / f"{page}_page.py").write_text(text, encoding="utf-8")
    # Two blocks import the same.
    options = {"typeCheckingMode": "strict", "reportDuplicateImport": False}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(options), encoding="utf-8")
    arguments = {
        # The cache in the current folder has numpy and the stubs from the other checks.
        "mypy": ["--strict", str(tmp_path)],
        # Pyright, packed for PyPI.
        "basedpyright": ["--pythonpath", sys.executable, "--project", str(tmp_path)],
    }
    command = [sys.executable, "-m", checker, *arguments[checker]]
    result = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("page", ["python.md", "simulation.md"])
def test_the_tests_on_a_page_pass(page: str, tmp_path: Path) -> None:
    tests = [block for _, block in blocks(DOCS / page) if "def test_" in block]
    file = tmp_path / "test_page.py"
    file.write_text("\n".join(tests), encoding="utf-8")
    # As a user does: a file in another folder, with the fixture of the installed package.
    command = [sys.executable, "-m", "pytest", "--quiet", "-p", "no:cacheprovider", str(file)]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stdout + result.stderr
    assert tests, "the page has a test"
