"""The stubs have the docstrings of the compiled module: editors show them.

`SNAPSHOT=write` writes them anew.
"""

from __future__ import annotations

import ast
import inspect
import os
from pathlib import Path

import sevenbot._sevenbot

STUBS = Path(__file__).parents[1] / "sevenbot" / "_sevenbot.pyi"
Place = ast.ClassDef | ast.FunctionDef


def docstring(found: object, indent: str) -> str | None:
    """The docstring of an object, as it stands in the stubs."""
    # For a static method itself, Python returns a text of its own, which differs between versions.
    text = inspect.getdoc(found.__func__ if isinstance(found, staticmethod) else found)
    if text is None:
        return None
    assert '"""' not in text
    lines = [f"{indent}{line}".rstrip() for line in text.splitlines()]
    end = '"""' if len(lines) == 1 else f'\n{indent}"""'
    return f'{indent}"""{lines[0].strip()}' + "".join(f"\n{line}" for line in lines[1:]) + end


def is_own(node: Place) -> bool:
    """True without a leading underscore: methods such as `__len__` need no docstring."""
    return not node.name.startswith("_")


def with_docstrings(text: str) -> str:
    """The stubs with the docstrings of the module."""
    tree, lines = ast.parse(text), text.splitlines()
    places: list[tuple[Place, object]] = []
    for node in tree.body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and is_own(node):
            owner = getattr(sevenbot._sevenbot, node.name)
            places.append((node, owner))
            for inner in getattr(node, "body", []):
                if isinstance(inner, ast.FunctionDef) and is_own(inner):
                    places.append((inner, inspect.getattr_static(owner, inner.name)))
    seen = set()
    replaced: list[tuple[Place, str]] = []
    for node, found in places:
        if id(found) in seen:
            continue
        seen.add(id(found))
        text_of = docstring(found, " " * (node.col_offset + 4))
        if text_of is not None:
            replaced.append((node, text_of))
    for node, text_of in reversed(replaced):
        first = node.body[0]
        has_text = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
        decorators = [decorator.lineno for decorator in getattr(first, "decorator_list", [])]
        line, last = min([first.lineno, *decorators]) - 1, (first.end_lineno or first.lineno) - 1
        if not has_text:
            lines[line:line] = text_of.splitlines()
        elif lines[line].strip().startswith(('"""', "...")):
            lines[line : last + 1] = text_of.splitlines()
        else:
            # `def name(self) -> None: ...`
            lines[line : last + 1] = [lines[line].removesuffix(" ..."), *text_of.splitlines()]
    return "\n".join(lines) + "\n"


def test_the_stubs_have_the_docstrings_of_the_module() -> None:
    text = STUBS.read_text(encoding="utf-8")
    wanted = with_docstrings(text)
    if os.environ.get("SNAPSHOT") == "write":
        STUBS.write_text(wanted, encoding="utf-8")
    assert wanted == text or os.environ.get("SNAPSHOT") == "write"
