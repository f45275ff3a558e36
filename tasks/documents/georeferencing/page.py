"""georeferencing_check.html: the page of a direct-georeferencing check, its drawings, its map as a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from adjust.arrays import Floats
from tasks.block.strip_names import strip_names
from tasks.coordinates.crs import MapFrame
from tasks.document_kit import axes, markup, palette
from tasks.document_kit.axes import Scale, tick_step
from tasks.document_kit.chart import BAR, LEFT, RIGHT, TOP, bars, chart
from tasks.document_kit.difference_arrows import ArrowScale, arrows, symbol
from tasks.document_kit.legend import Swatch
from tasks.document_kit.map_plot import MapPlot
from tasks.document_kit.raster import Classes
from tasks.document_kit.templates import rendered
from tasks.documents.georeferencing import check_tables
from tasks.documents.georeferencing.material import CheckMaterial, verdict
from tasks.documents.report.key_figures import gate_table
from tasks.documents.report.page import TEMPLATES as REPORT_TEMPLATES
from tasks.documents.report.provenance import files_table, settings_table, versions_table
from tasks.georeferencing.point_differences import INDEPENDENT

_TEMPLATES = Path(__file__).parent / "templates"


def render(material: CheckMaterial, name: str, files: Sequence[str], software: Mapping[str, str]) -> str:
    """The page as text."""
    project = material.project
    tables = (
        *check_tables.difference_tables(material),
        check_tables.source_table(material),
        check_tables.point_table(material),
        check_tables.statement_table(material),
        check_tables.parallax_table(material),
        check_tables.model_table(material),
        check_tables.calibration_table(material),
        gate_table(material.summary.gates),
        settings_table(project),
        files_table(project, files),
        versions_table(software),
    )
    return rendered(
        "georeferencing_check.html.j2",
        _TEMPLATES,
        REPORT_TEMPLATES,
        name=name,
        frame=MapFrame.of(project.project.crs, project.project.heights).description,
        verdict=verdict(material),
        problems=material.summary.problems,
        figures=material.figures,
        tables={table.name: table for table in tables},
        plots=_plots(material),
    )


def _plots(material: CheckMaterial) -> dict[str, Markup]:
    """The plots for which there is something to show."""
    drawn = {}
    if len(material.points):
        drawn["differences"] = difference_map(material)
    if material.figures.y_parallaxes:
        drawn["parallaxes"] = parallax_map(material)
        drawn["histogram"] = parallax_histogram(material)
    return drawn


# Above this many images their places would hide the points.
_MOST_IMAGES = 3000


def difference_map(material: CheckMaterial) -> Markup:
    """Arrows of the differences over the strips; needs at least one point."""
    points, exposures = material.points, material.exposures
    flown = exposures[["x_m", "y_m"]].to_numpy(np.float64)
    everything = np.vstack([flown, points[["x_m", "y_m"]].to_numpy(np.float64)])
    plot = MapPlot.over(everything[:, 0], everything[:, 1])
    parts = [plot.axes(), _strips(material, plot)]
    scale = ArrowScale.of(points)
    for row in points.to_dict("records"):
        place = plot.x.at(float(str(row["x_m"]))), plot.y.at(float(str(row["y_m"])))
        if scale is not None:
            parts += arrows(row, place, scale)
        shown = [
            f"d{axis} {float(str(row[f'd{axis}_m'])):+z.3f} m"
            for axis in "xyz"
            if np.isfinite(float(str(row[f"d{axis}_m"])))
        ]
        kind = "check point" if row["status"] == INDEPENDENT else "calibration control"
        words = f"{kind} {row['point']}: {', '.join(shown)}"
        parts.append(symbol(place, row["status"] == INDEPENDENT, took_part=True, words=words))
    y = plot.bottom + 6
    x = plot.legend_x
    for is_check, words, width in (
        (True, "independent check point", 190.0),
        (False, "calibration control", 200.0),
    ):
        parts += [symbol((x + 7, y + 10), is_check, took_part=True, words="")]
        parts.append(markup.text(x + 20, y + 14, words, "start"))
        x += width
    if scale is not None:
        parts.append(scale.legend(x + 10, y + 10))
    return markup.svg(axes.WIDTH, y + 34, "Map of the differences", *parts)


def _strips(material: CheckMaterial, plot: MapPlot) -> Markup:
    """A line through the exposures of every strip."""
    exposures = material.exposures
    if len(exposures) > _MOST_IMAGES:
        return Markup("")
    lines = []
    named = exposures[exposures["strip"].notna()]
    names = strip_names(named["flight"].fillna(""), named["strip"])
    for name, strip in named.groupby(names, sort=True):
        ordered = strip.sort_values(["time_s", "image"], kind="stable")
        x, y = (scale.of(ordered[c].to_numpy(np.float64)) for scale, c in ((plot.x, "x_m"), (plot.y, "y_m")))
        path = markup.path_of(x, y)
        lines.append(
            markup.element("path", markup.title(f"strip {name}"), css="track", d=path, stroke=palette.FAINT)
        )
    return markup.group("strips", lines)


_BINS = 60
_ABOUT_CLASSES = 6
# Half the length of the stroke that stands for a model, in parts of its base.
_HALF = 0.42
_MOST_TITLES = 3000
# To the right of the flight, drawing units: lines flown forward and back lie side by side.
_ASIDE = 3.0


def parallax_map(material: CheckMaterial) -> Markup:
    """A stroke next to the base of every model, coloured by the RMS of its y-parallaxes; needs one model."""
    models = material.models[material.models["points"] > 0]
    place = material.exposures.set_index("image")[["x_m", "y_m"]]
    left, right = (place.loc[models[side]].to_numpy(np.float64) for side in ("left", "right"))
    everything = np.vstack([left, right])
    plot = MapPlot.over(everything[:, 0], everything[:, 1])
    rms = models["rms_um"].to_numpy(np.float64)
    classes = parallax_classes(rms)
    # The lightest colour of all cannot be seen on paper.
    colours = palette.sequence(len(classes.words) + 1)[1:]
    titles = [
        f"{row['left']} – {row['right']}: RMS {row['rms_um']:.1f} µm, largest {row['max_um']:.1f} µm"
        for row in models.to_dict("records")
    ]
    x, y = _strokes(plot, left, right)
    strokes = []
    for index, colour in enumerate(colours):
        for i in np.flatnonzero(classes.of(rms) == index):
            data = markup.path_of(x[i], y[i])
            named = [markup.title(titles[i])] if len(models) <= _MOST_TITLES else []
            strokes.append(markup.element("path", *named, css="model", stroke=colour, d=data))
    entries = [Swatch(colour, words) for colour, words in zip(colours, classes.words, strict=True)]
    legend, bottom = plot.legend("RMS [µm]", entries)
    drawn = markup.group("models", strokes)
    return markup.svg(axes.WIDTH, bottom + 6, "Map of the y-parallaxes", plot.axes(), drawn, legend)


def _strokes(plot: MapPlot, left: Floats, right: Floats) -> tuple[Floats, Floats]:
    """Ends (m, 2), (m, 2) of the strokes in the drawing, somewhat to the right of the bases (m, 2)."""
    middle, half = 0.5 * (left + right), _HALF * (right - left)
    ends = np.stack([middle - half, middle + half], axis=1)
    x, y = plot.x.of(ends[:, :, 0]), plot.y.of(ends[:, :, 1])
    along = np.stack([x[:, 1] - x[:, 0], y[:, 1] - y[:, 0]], axis=1)
    along = along / np.maximum(np.hypot(along[:, :1], along[:, 1:]), 1e-9)
    # y of the drawing points down, so right of (a, b) is (−b, a).
    return x - _ASIDE * along[:, 1:], y + _ASIDE * along[:, :1]


def parallax_classes(values: Floats) -> Classes:
    """Classes of round width over the values (n,); the outermost ones are open."""
    step = tick_step(float(np.ptp(values)) or float(np.max(values)) or 1.0, _ABOUT_CLASSES)
    first, last = int(np.floor(values.min() / step)) + 1, int(np.ceil(values.max() / step))
    return Classes.between(step * np.arange(first, max(last, first + 1), dtype=np.float64), step)


def parallax_histogram(material: CheckMaterial) -> Markup:
    """Bars of the y-parallaxes, and the distribution expected from their predicted σ; needs one parallax."""
    table = material.parallaxes[material.parallaxes["status"] == "used"]
    values, sigma = (table[name].to_numpy(np.float64) for name in ("parallax_um", "sigma_um"))
    largest = float(np.abs(values).max()) or 1.0
    limit = tick_step(largest, 1) if largest > 0.5 * tick_step(largest, 1) else 0.5 * tick_step(largest, 1)
    counts, edges = np.histogram(values, bins=_BINS, range=(-limit, limit))
    width = 2.0 * limit / _BINS
    at = np.linspace(-limit, limit, 241)
    curve = len(values) * width * _mixture(at, sigma)
    x = Scale(-limit, limit, LEFT, RIGHT)
    y = Scale(0.0, 1.06 * max(float(counts.max()), float(curve.max()), 1.0), 270.0, TOP)
    return chart(
        "Histogram of the y-parallaxes",
        x,
        y,
        ("y-parallax [µm]", "number in a bar"),
        (bars(x, y, edges, counts), markup.curve(x.of(at), y.of(curve), palette.ACCENT)),
        [
            Swatch(BAR, f"{len(values):,} y-parallaxes"),
            Swatch(palette.ACCENT, "expected from the predicted σ"),
        ],
        "y-parallaxes",
        about=10,
    )


def _mixture(at: Floats, sigma: Floats) -> Floats:
    """Density (k,) of a value drawn from normal distributions with standard deviations (n,).

    The σ are taken by their hundred quantiles, so that a million parallaxes cost no more than a hundred.
    """
    spread = np.quantile(sigma, (np.arange(100) + 0.5) / 100)
    each = np.exp(-0.5 * (at[:, None] / spread) ** 2) / (spread * np.sqrt(2.0 * np.pi))
    return np.asarray(each.mean(axis=1))
