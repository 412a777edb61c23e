"""Runs the Python blocks of docs/python.md, in order, in one namespace."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "python.md"


def blocks() -> list[tuple[int, str]]:
    """The blocks with their first lines."""
    text = PAGE.read_text(encoding="utf-8")
    found = re.finditer(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    return [(text.count("\n", 0, block.start(1)) + 1, block.group(1)) for block in found]


def test_the_blocks_of_the_first_steps_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "first_steps"}
    for line, block in blocks():
        # The empty lines give a traceback the line of the page.
        exec(compile("\n" * (line - 1) + block, str(PAGE), "exec"), names)
    assert len(blocks()) >= 8
