"""Every work that code cites stands in docs/references.bib."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_every_citation_resolves() -> None:
    known = set(re.findall(r"@\w+\{(\w+),", (ROOT / "docs" / "references.bib").read_text("utf-8")))
    files = [
        path for folder in ("skincli", "shaders") for path in (ROOT / folder).rglob("*.*") if path.suffix != ".pyc"
    ]
    cited = {key for path in files for key in re.findall(r"\[([A-Za-z]+\d{4})\b", path.read_text("utf-8"))}
    assert len(cited) > 5
    assert cited <= known
