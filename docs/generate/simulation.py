"""Write docs/simulation.md from the settings themselves: ``python -m docs.generate.simulation``.

The page cannot be out of date: a test compares the committed file with what this module writes.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from docs.generate.settings import settings_section
from tasks.settings.base import Settings
from tasks.settings.load_simulation import preset_names, preset_text
from tasks.settings.simulated_truth import (
    PublishedCheck,
    SimulatedGrossErrors,
    SimulatedImageErrors,
    SimulatedNoise,
    SimulatedTruth,
)
from tasks.settings.simulation import (
    FlightLines,
    PlannedCamera,
    SimulatedControl,
    SimulatedFilm,
    SimulatedHead,
    SimulatedPoints,
    SimulatedProject,
    SimulatedTerrain,
    SimulatedTrajectory,
    Simulation,
)

_TABLES: tuple[tuple[str, type[Settings], str], ...] = (
    ("the specification", Simulation, "The top level."),
    ("[project]", SimulatedProject, ""),
    ("[camera]", PlannedCamera, ""),
    ("[[head]]", SimulatedHead, ""),
    ("[film]", SimulatedFilm, "Marks are delivered in `fiducials.csv`, points as measured in the scans."),
    ("[[flight]]", FlightLines, ""),
    ("[trajectory]", SimulatedTrajectory, ""),
    ("[terrain]", SimulatedTerrain, ""),
    ("[points]", SimulatedPoints, ""),
    ("[[control]]", SimulatedControl, ""),
    ("[noise]", SimulatedNoise, ""),
    ("[noise.gross_errors]", SimulatedGrossErrors, ""),
    ("[truth]", SimulatedTruth, ""),
    ("truth.published", PublishedCheck, ""),
    ("[truth.image_errors]", SimulatedImageErrors, ""),
)

_OPENING = """\
# Simulated blocks

*Written by `python -m docs.generate.simulation` from the settings themselves; edit the
descriptions there.*

`aerocal simulate PRESET --out DIR` writes a complete project with known true values: `project.toml` with its three
text files as a client would deliver them, and the true values in `DIR/truth/`. The true values are used only for
comparison.

| file in `truth/` | content |
|---|---|
| `exterior_orientations.parquet` | true orientations, in the frame and angles of the results |
| `object_points.parquet`, `control_points.parquet` | true points; which coordinates of a surveyed point are delivered |
| `parameters.parquet` | true values of all system parameters, and the values stated in the project |
| `gross_errors.parquet` | all gross errors that were introduced |
| `image_errors.parquet` | the systematic image errors on a grid over the format |
| `spec.toml` | the complete specification; `aerocal simulate DIR/truth/spec.toml` writes the same bytes again |

A SPEC.toml names a preset and the changes to it:

```toml
preset = "uce-low"
seed = 7
[flight]
height_m = 900.0        # a single table changes all groups of lines of the preset
[control]
control = 10            # ten control points, the rest are check points
[noise]
level = 0               # free of noise
```

- Each random source has its own stream of random numbers. If one source is switched off, the numbers of all
  others remain the same. The true values never depend on the noise.
- The stated standard deviations are those used to generate the noise. An adjustment with the correct model
  therefore has a σ0 of 1.
- Numbers are written with enough digits (1e-9 mm, 1e-12 degrees, 1e-9 m) to recover the true values from a
  project without noise.
- If a preset has several groups (`[[flight]]`, `[[control]]`), a single table in SPEC.toml changes all of
  them; tables in double brackets replace them all.
- x is east, y is north; the centre of the block is the origin of a local frame.

## Presets
"""  # noqa: E501


def simulation_page() -> str:
    """The whole page as Markdown."""
    lines = [_OPENING, *_presets()]
    for title, model, remark in _TABLES:
        lines += settings_section(title, model, remark)
    return "\n".join(lines).rstrip() + "\n"


def _presets() -> Iterator[str]:
    yield "| name | block |"
    yield "|---|---|"
    for name in preset_names():
        yield f"| `{name}` | {preset_text(name).splitlines()[0].removeprefix('# ')} |"
    yield ""


def main() -> None:
    """Write the page into docs/ of the repository the command is run in, or to the path given."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/simulation.md")
    target.write_text(simulation_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
