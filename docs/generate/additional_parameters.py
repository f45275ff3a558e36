"""Write docs/additional-parameters.md from the register itself.

``python -m docs.generate.additional_parameters``. The page cannot be out of date: a test compares
the committed file with what this module writes.
"""

from __future__ import annotations

import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

from adjust.camera.additional.base import ImageFormat, ParameterSet
from adjust.camera.additional.effect import effects
from adjust.camera.additional.register import REGISTER, AdditionalParameters
from adjust.camera.additional.selection import SelectedTerms

# UltraCam Eagle: 13080 × 20010 pixels of 5.2 µm, columns along flight.
_FORMAT = ImageFormat(34.008e-3, 52.026e-3, focal_length=0.080)
_MICROMETRE = 1e-6
# Longer tables are folded.
_MOST_ROWS = 30

_OPENING = """\
# Additional parameters

*Written by `python -m docs.generate.additional_parameters` from the register in
`adjust/camera/additional/register.py`; edit the descriptions in the files of the sets.*

Additional parameters a_k describe the deviations of a camera from the central perspective defined by focal
length and principal point. The adjustment estimates them together with all other unknowns (self-calibration):

    x_ideal = x̄ + Σ f_k(x̄, ȳ) a_k,      x̄ = x_measured − x0,  ȳ = y_measured − y0.

The sum is the correction Δ of the measurement; **the systematic image error is −Δ**. Where the literature
writes x' = x − f · P, the sign is reversed here: the values are those of the literature, f_k is −f. Axes and
signs: [conventions](conventions.md).

Sets with *forward* in their name work in the opposite direction, as in OpenCV, COLMAP, Metashape, OpenSfM and
Pix4D. They describe a distortion d of the ideal direction u = (x_ideal, y_ideal)/c,

    x̄ + Δ = c (u + d(u)).

Both types can be combined: the measurement is corrected first. Their values are not interchangeable;
[converting](#converting-between-directions) explains how to derive one from the other.

## Selecting parameters

`[adjustment.self_calibration]` of the [project file](project-file.md) has a key `parameters` with a text:

| text | selects |
|---|---|
| `brown` | all parameters of a set |
| `brown:K1,K2` | some of them |
| `brown-forward:k1-k3,p1,p2` | ranges and names |
| `bluh:1-12` | a range, by the order of the set |
| `bluh:1-12+42-73+81-88` | several ranges of one set |
| `brown:K1,K2+legendre(3)` | parameters of several sets; some sets have a degree |
| `bluh12+uc` | short forms, see the table below |
| `none` | nothing |

A parameter is reported as `SET:NAME`, such as `bluh:7`. Unknown names, names selected twice, and linearly
dependent parameters of a set are errors.

| short form | stands for |
|---|---|
"""

_AFTER_PRESETS = """\

Sets are defined in *calibration axes*. Where the direction matters, x points along the flight. Image
coordinates are rotated into these axes by a multiple of 90°, and the corrections are rotated back.

In Python, with the effect of each parameter over the image:

```python
>>> from adjust.camera.additional.base import ImageFormat
>>> from adjust.camera.additional.effect import effects
>>> from adjust.camera.additional.register import additional_parameters
>>> eagle = ImageFormat(half_x=34.008e-3, half_y=52.026e-3)
>>> parameters = additional_parameters("bluh:1,9+81", eagle)
>>> parameters.names, parameters.units
(('bluh:1', 'bluh:9', 'bluh:81'), ('1', '1/mm²', 'mm'))
>>> [f"{value:.2e}" for value in 1e-6 / effects(parameters).largest]
['1.61e-05', '1.60e-09', '1.00e-03']
```

## The sets

"""

_CONVERTING = """\

## Converting between directions

| from | to `brown-forward` |
|---|---|
| OpenCV, COLMAP `OPENCV`, OpenSfM `brown`, OPF | k1, k2, k3, p1, p2 unchanged |
| COLMAP `FULL_OPENCV`, OpenCV rational | likewise if k4, k5, k6 are zero; otherwise not possible |
| Metashape | k1 to k4 unchanged; p1 = P2, p2 = P1; b1 = B1/f, b2 = B2/f, f in pixels |
| fx, fy in pixels | c = fy times the pixel size, b1 = fx/fy − 1 |
| cx, cy in pixels from the corner | x0, y0 = (cx − columns/2, rows/2 − cy) times the pixel size |
| Australis, PhotoModeler, laboratories | not applicable: these are corrections, use `brown` or `brown_mm` |

`aerocal convert-distortion PROJECT.toml --to brown_mm:K1-K3,P1,P2` converts the given values of a camera in
the project (`cameras.NAME.additional_parameters`) into any other selection. Ideal points are computed from
measured points over the format, and the other values are found by least squares. The remaining differences
are shown (largest and RMS, µm; a warning above 0.1 µm). c, x0 and y0 are unchanged. A lens with 0.5 mm of
distortion at c = 80 mm is converted to 0.06 µm, one with 1.3 mm and decentring of 20 µm to 0.6 µm.

With corrections, residuals refer to the ideal point; with distortions, to the measured image. The stated σ of
image points therefore have slightly different weights: with 0.5 mm of distortion, σ0 differs by 0.4 %.

If given values are held fixed, the [tests of the model](theory/adjustment.md#alternatives-of-the-model) check
whether the other direction or the opposite sign fits better, and report it.
"""

_AFTER_SETS = """
A parameter is *published* if its formula is printed in the source. It is *reconstructed* if the source gives
only a name, a number or a description, or if its formula is quoted from memory. A reconstructed parameter has
the effect stated by its name, but may differ from the one in the program of its author.

In the tables below, *1 µm* is the value whose largest effect |Δ| in the image of an UltraCam Eagle (68.016
mm along × 104.052 mm across flight) is 1 µm, and *RMS* the root mean square of its effect over that image.
Effects are proportional: three times the value displaces by 3 µm.
"""


def additional_parameters_page() -> str:
    """The whole page as Markdown."""
    sets = tuple(_sets())
    lines = [_OPENING.rstrip("\n")]
    lines += [f"| `{name}` | `{text}` |" for name, text in REGISTER.presets.items()]
    lines += [
        _AFTER_PRESETS.rstrip("\n"),
        "",
        "| set | what it is | parameters | status |",
        "|---|---|---|---|",
    ]
    lines += [_summary_row(heading, item) for heading, item in sets]
    lines.append(_AFTER_SETS)
    for place, (heading, item) in enumerate(sets):
        alike = next((name for name, other in sets[:place] if other.formulas == item.formulas), None)
        lines += _section(heading, item, alike)
    lines.append(_CONVERTING.strip("\n"))
    return "\n".join(lines).rstrip() + "\n"


def _sets() -> Iterator[tuple[str, ParameterSet]]:
    """Every set, and what its name is to be written as; of those with a degree the usual one."""
    for name, item in REGISTER.sets.items():
        yield name, item
    for name, family in REGISTER.by_degree.items():
        yield f"{name}(n)", family.of_degree(family.usual)


def _summary_row(heading: str, item: ParameterSet) -> str:
    statuses = sorted({term.status for term in item.terms})
    if len(statuses) > 1:
        published = sum(term.status == "published" for term in item.terms)
        said = f"{published} published, {len(item.terms) - published} reconstructed"
    else:
        said = statuses[0]
    number = f"{len(item.terms)}" if heading == item.name else f"{len(item.terms)} in `{item.name}`"
    return f"| [`{heading}`](#{_anchor(heading)}) | {item.title} | {number} | {said} |"


def _section(heading: str, item: ParameterSet, alike: str | None) -> Iterator[str]:
    """Lines of the section on one set; ``alike`` names an earlier set with the same formulas."""
    yield f"## `{heading}`"
    yield ""
    yield _filled(f"{item.title[0].upper()}{item.title[1:]}. Source: {item.source}.")
    degrees = ""
    if heading != item.name:
        family = REGISTER.by_degree[heading.partition("(")[0]]
        degrees = f" Degrees {family.degrees[0]} to {family.degrees[-1]}; the table shows `{item.name}`."
    if item.note or degrees:
        yield ""
        yield _filled(f"{item.note}{degrees}".strip())
    for combination in item.combinations:
        yield ""
        yield _filled(
            f"{combination.term} is a linear combination of {', '.join(combination.of)}: it can be selected "
            "instead of one of them, but not together with all of them."
        )
    yield ""
    if alike is None:
        yield from _as_markdown(item.formulas)
    else:
        yield from (f"The formulas are those of [`{alike}`](#{_anchor(alike)}).", "")
    yield from _table(item)


def _anchor(heading: str) -> str:
    return re.sub(r"[^\w-]", "", heading)


def _filled(text: str) -> str:
    return textwrap.fill(text, width=110, break_on_hyphens=False)


def _as_markdown(text: str) -> Iterator[str]:
    """A docstring as Markdown: formulas stay as they are, names of code become code, references links."""
    for line in text.strip().split("\n"):
        if line.startswith("    "):
            yield line
        else:
            linked = re.sub(r":(mod|func|class):`~?([\w.]+)`", _link, line)
            yield re.sub(r"``([^`]+)``", r"`\1`", linked)
    yield ""


def _link(reference: re.Match[str]) -> str:
    """A link to the file of a module, or to that which something is in."""
    kind, name = reference.groups()
    module = name if kind == "mod" else name.rpartition(".")[0]
    return f"[`{name.rpartition('.')[2]}`](../{module.replace('.', '/')}.py)"


def _table(item: ParameterSet) -> Iterator[str]:
    parameters = AdditionalParameters(
        (SelectedTerms(item, tuple(term.name for term in item.terms)),), _FORMAT
    )
    found = effects(parameters)
    folded = len(item.terms) > _MOST_ROWS
    if folded:
        yield from ("<details>", f"<summary>The {len(item.terms)} parameters of {item.name}</summary>", "")
    yield "| name | meaning | unit | status | 1 µm | RMS, µm |"
    yield "|---|---|---|---|---|---|"
    for term, largest, rms in zip(item.terms, found.largest, found.rms, strict=True):
        effect = f"{_three_digits(_MICROMETRE / largest)} | {rms / largest:.2f}"
        yield f"| `{term.name}` | {term.meaning} | {term.unit} | {term.status} | {effect} |"
    yield ""
    if folded:
        yield from ("</details>", "")


def _three_digits(value: float) -> str:
    """A positive number with three digits, as a power of ten where it is small or large."""
    if 0.01 <= value < 1000.0:
        return f"{value:.3g}"
    mantissa, exponent = f"{value:.2e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def main() -> None:
    """Write the page into docs/ of the repository the command is run in, or to the path given."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/additional-parameters.md")
    target.write_text(additional_parameters_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
