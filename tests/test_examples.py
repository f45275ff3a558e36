"""Every example runs and prints what its header says."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_example_prints_what_its_header_promises(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    header = path.read_text(encoding="utf-8").split('"""')[1]
    promised = [line.strip() for line in header.splitlines() if line.startswith("    ")]
    assert promised
    runpy.run_path(str(path), run_name="__main__")
    assert capsys.readouterr().out.splitlines() == promised
