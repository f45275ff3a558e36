"""A result as a picture: the block in plan, coloured by the accuracy of its points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from adjust.errors import MissingExtraError
from adjust.result import ObservationStatus
from adjust.result_columns import sigma_of_points

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

    from adjust.result import AdjustmentResult


def plan(result: AdjustmentResult) -> Figure:
    """Exposures, and object points coloured by the σ of their height; what was rejected is marked.

    Raises
    ------
    MissingExtraError : plotly is not installed.
    """
    try:
        from plotly.graph_objects import Figure, Scattergl
    except ImportError as error:
        raise MissingExtraError("A picture of the result", "plotly", "plot") from error
    sigma = 1e3 * sigma_of_points(result)[:, 2]
    points, images = result.state.object_point, result.state.pictures.projection_centre
    shown = np.flatnonzero(result.active_point)
    rays = result.groups[0]
    rejected = np.unique(rays.group.point[(rays.status == ObservationStatus.REJECTED).any(axis=1)])
    figure = Figure(
        [
            Scattergl(
                x=points[shown, 0],
                y=points[shown, 1],
                mode="markers",
                name="object points",
                text=[f"{result.block.points[j]}: σz {sigma[j]:.1f} mm" for j in shown],
                marker={
                    "color": sigma[shown],
                    "colorscale": "Viridis",
                    "cmax": float(np.quantile(sigma[shown], 0.98)) if len(shown) else 1.0,
                    "size": 4,
                    "colorbar": {"title": {"text": "σz [mm]"}},
                },
            ),
            Scattergl(
                x=images[:, 0],
                y=images[:, 1],
                mode="markers",
                name="exposures",
                text=list(result.block.images),
                marker={"symbol": "triangle-up", "color": "black", "size": 7},
            ),
            Scattergl(
                x=points[rejected, 0],
                y=points[rejected, 1],
                mode="markers",
                name="points with a rejected image point",
                text=[result.block.points[j] for j in rejected],
                marker={"symbol": "circle-open", "color": "crimson", "size": 9},
            ),
        ]
    )
    figure.update_layout(
        template="plotly_white",
        title=f"σ0 {result.test.sigma0:.3f}, redundancy {result.test.redundancy:,}",
        xaxis_title="x [m], local frame",
        yaxis_title="y [m], local frame",
        legend={"orientation": "h", "y": -0.2},
    )
    figure.update_yaxes(scaleanchor="x")
    return figure
