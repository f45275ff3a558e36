"""Arrows at the projection centres: adjusted minus GNSS position, in plan."""

from __future__ import annotations

import numpy as np
import pandas as pd
from markupsafe import Markup

from tasks.document_kit import markup
from tasks.document_kit.difference_arrows import ArrowScale, length_words
from tasks.document_kit.legend import arrow_scale
from tasks.document_kit.map_plot import MapPlot
from tasks.documents.report.material import Material

_GROUP = "gnss_positions"
#: Above this many images arrows would only be a grey area.
MOST_IMAGES = 600


def position_differences(material: Material, images: pd.DataFrame) -> pd.DataFrame:
    """image, x_m, y_m, dx_m, dy_m, dz_m of each image with a GNSS position, rejected or not."""
    table = material.residuals
    if table.empty or len(images) > MOST_IMAGES:
        return pd.DataFrame(columns=["image", "x_m", "y_m", "dx_m", "dy_m", "dz_m"], dtype=np.float64)
    own = table[(table["group"] == _GROUP) & table["component"].isin(list("xyz")) & table["image"].notna()]
    wide = own.pivot_table(index="image", columns="component", values="residual", aggfunc="first")
    wide = wide.reindex(columns=list("xyz")).set_axis(["dx_m", "dy_m", "dz_m"], axis=1)
    return images[["image", "x_m", "y_m"]].merge(wide, left_on="image", right_index=True)


def position_arrows(found: pd.DataFrame, scale: ArrowScale, plot: MapPlot, y: float) -> Markup:
    """The arrows of ``position_differences`` with their legend at the height y."""
    dx, dy = (np.nan_to_num(found[name].to_numpy(np.float64)) * scale.unit for name in ("dx_m", "dy_m"))
    places = zip(plot.x.of(found["x_m"].to_numpy()), plot.y.of(found["y_m"].to_numpy()), strict=True)
    data = "".join(
        markup.arrow(float(east), float(north), float(right), float(-up))
        for (east, north), right, up in zip(places, dx, dy, strict=True)
        if right or up
    )
    length = scale.length_m * scale.unit
    words = f"{length_words(scale.length_m)} in plan, adjusted − GNSS position"
    legend = arrow_scale(plot.x.start, y + 10, length, words, "gnss")
    arrows = markup.element("path", {"class": "gnss", "d": data})
    return markup.group("positions", [arrows, legend])
