"""Lines of the product by room: ``python -m benchmarks.product_lines [DEPTH] [FOLDER …]``.

Lines with code, without comments, blank lines and docstrings, which are counted apart; of `tasks` and `flows`
unless other folders are named.
"""

from __future__ import annotations

import ast
import sys
import tokenize
from collections import Counter
from pathlib import Path

_SKIPPED = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER,
    tokenize.ENCODING,
}  # fmt: skip


def lines_of(path: Path) -> tuple[int, int]:
    """Lines with code, and lines of docstrings."""
    with path.open("rb") as stream:
        tokens = [one for one in tokenize.tokenize(stream.readline) if one.type not in _SKIPPED]
    lines = {line for one in tokens for line in range(one.start[0], one.end[0] + 1)}
    documented = set[int]()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for part in node.body if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) else ():
            if isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant):
                documented.update(range(part.lineno, (part.end_lineno or part.lineno) + 1))
    return len(lines - documented), len(lines & documented)


def main(depth: int, folders: list[str]) -> None:
    """Print a line for each room, the largest first, and the sum."""
    code, documented, files = Counter[str](), Counter[str](), Counter[str]()
    for path in (file for folder in folders for file in Path(folder).rglob("*.py")):
        own, text = lines_of(path)
        for room in ("/".join(path.parts[:-1][:depth]), "together"):
            code[room] += own
            documented[room] += text
            files[room] += 1
    for room, number in code.most_common():
        print(
            f"{room:40} {number:7,} lines of code, {documented[room]:6,} of docstrings, {files[room]:4} files"
        )


if __name__ == "__main__":
    main(int(next(iter(sys.argv[1:]), "2")), sys.argv[2:] or ["tasks", "flows"])
