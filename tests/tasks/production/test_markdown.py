"""Names in Markdown are shown as they are, and mean nothing."""

from __future__ import annotations

import re
from html import unescape

import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from tasks.production.short_text import code, inert

#: The kind of Markdown the dashboard renders: tables and strikethrough, and raw HTML let through.
RENDERER = MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"])

HOSTILE = (
    "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "[click](javascript:alert(1))",
    "![pixel](http://elsewhere/pixel.png)",
    "a | b | c",
    "`code` ``more``",
    "*bold* _it_ __under__ ~~gone~~",
    "# heading",
    "- item",
    "1. item",
    "1)",
    "+ plus",
    "---",
    "===",
    "> quoted",
    "&lt;b&gt; &amp; &#x41;",
    "back\\slash \\* \\",
    "$x^2$",
    "</td></tr></table><h1>x",
)


def shown(html: str) -> str:
    """The text of a rendered page; fails if any tag but those of the frame is in it."""
    assert set(re.findall(r"</?(\w+)", html)) <= {
        "p",
        "ul",
        "li",
        "table",
        "thead",
        "tbody",
        "tr",
        "th",
        "td",
    }
    return unescape(re.sub(r"<[^>]+>", "", html))


@pytest.mark.parametrize("text", HOSTILE)
def test_a_hostile_name_is_only_shown(text: str) -> None:
    assert shown(RENDERER.render(inert(text))).strip() == text
    assert shown(RENDERER.render(f"- {inert(text)}")).strip() == text
    table = RENDERER.render(f"| a | b |\n| --- | --- |\n| {inert(text)} | second |\n")
    cells = [unescape(cell) for cell in re.findall(r"<td>(.*?)</td>", table)]
    assert cells == [text, "second"]


@given(st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Zs", "Zl", "Zp")), min_size=1))
def test_any_text_is_only_shown(text: str) -> None:
    assert "\\u" in inert(text) or shown(RENDERER.render(f"x {inert(text)}")).strip() == f"x {text}"


def test_line_ends_do_not_end_the_line() -> None:
    assert inert("a\r\n\r\n# b\n| c |") == "a \\# b \\| c \\|"
    assert "\n" not in code("a\n\n`b`")


@pytest.mark.parametrize("text", ["plain/path_1", "with `one`", "``two`` and `", "`", "<b>&amp;</b>"])
def test_a_path_is_shown_as_code(text: str) -> None:
    (found,) = re.findall(r"<code>(.*?)</code>", RENDERER.render(code(text)))
    assert unescape(found) == text
