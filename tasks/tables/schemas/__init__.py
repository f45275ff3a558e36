"""The Parquet contracts: every table's columns with type, unit and meaning, and its key.

The key is also the sort order. Names and meanings of published tables are a contract: they are extended,
never renamed. A number that does not exist is null, never zero or NaN. A new table is a `TableSchema` in the
file of its subject and a line in `SCHEMAS`; users see it if `tasks.results.publish` names it.
"""

from __future__ import annotations

from tasks.tables.schemas.adjustment import (
    CHECK_POINTS,
    CONTROL_RESIDUALS,
    DISTANCE_RESIDUALS,
    EXTERIOR_ORIENTATIONS,
    NEIGHBOURING_IMAGES,
    OBJECT_POINTS,
    RESIDUALS,
)
from tasks.tables.schemas.columns import Column, ColumnType, TableSchema
from tasks.tables.schemas.deliveries import (
    APPROXIMATE_BORESIGHT,
    APPROXIMATE_ORIENTATIONS,
    APPROXIMATE_POINTS,
    CAMERAS,
    CONTROL_POINTS,
    DISTANCES,
    EXPOSURES,
    IMAGE_POINTS,
    IMAGES,
    TRAJECTORIES,
)
from tasks.tables.schemas.film import FILM_ORIENTATIONS
from tasks.tables.schemas.georeferencing import (
    DIRECT_GEOREFERENCING,
    DIRECT_GEOREFERENCING_MODELS,
    STEREO_MODELS,
    Y_PARALLAXES,
)
from tasks.tables.schemas.image_quality import (
    APERTURE,
    DEFECT_COLUMNS,
    DEFECT_PIXELS,
    EDGE_DRIFT,
    EDGE_MEANS,
    EDGE_RESPONSES,
    EDGES,
    NOISE_LEVELS,
    PHOTON_TRANSFER,
    QUALITY_DRIFT,
    SENSOR_SHEETS,
    SMEAR_MOTION,
    SMEARS,
)
from tasks.tables.schemas.model_tests import MODEL_ALTERNATIVE_EFFECTS, MODEL_ALTERNATIVES
from tasks.tables.schemas.parameters import (
    CORRELATIONS,
    PARAMETER_INFLUENCES,
    PARAMETERS,
    SELF_CALIBRATION,
)
from tasks.tables.schemas.platform import PLATFORM, VIRTUAL_IMAGE
from tasks.tables.schemas.residual_grid import RESIDUAL_AUTOCORRELATION, RESIDUAL_GRID
from tasks.tables.schemas.sweep import SWEEP
from tasks.tables.schemas.trust_map import TRUST_MAP_CELLS
from tasks.tables.schemas.two_step import (
    ORIENTATION_DIFFERENCE_MEANS,
    ORIENTATION_DIFFERENCES,
    STRIP_ERRORS,
)

#: All tables, in the order in which they are documented.
SCHEMAS: dict[str, TableSchema] = {
    schema.name: schema
    for schema in (
        CAMERAS,
        IMAGES,
        IMAGE_POINTS,
        EXPOSURES,
        TRAJECTORIES,
        CONTROL_POINTS,
        DISTANCES,
        APPROXIMATE_ORIENTATIONS,
        APPROXIMATE_POINTS,
        APPROXIMATE_BORESIGHT,
        EXTERIOR_ORIENTATIONS,
        NEIGHBOURING_IMAGES,
        OBJECT_POINTS,
        RESIDUALS,
        PARAMETERS,
        SELF_CALIBRATION,
        CORRELATIONS,
        PARAMETER_INFLUENCES,
        MODEL_ALTERNATIVES,
        MODEL_ALTERNATIVE_EFFECTS,
        CONTROL_RESIDUALS,
        CHECK_POINTS,
        DISTANCE_RESIDUALS,
        ORIENTATION_DIFFERENCES,
        ORIENTATION_DIFFERENCE_MEANS,
        STRIP_ERRORS,
        SWEEP,
        RESIDUAL_GRID,
        RESIDUAL_AUTOCORRELATION,
        TRUST_MAP_CELLS,
        FILM_ORIENTATIONS,
        DIRECT_GEOREFERENCING,
        DIRECT_GEOREFERENCING_MODELS,
        Y_PARALLAXES,
        STEREO_MODELS,
        EDGES,
        EDGE_MEANS,
        EDGE_DRIFT,
        SMEARS,
        SMEAR_MOTION,
        QUALITY_DRIFT,
        EDGE_RESPONSES,
        NOISE_LEVELS,
        SENSOR_SHEETS,
        DEFECT_PIXELS,
        DEFECT_COLUMNS,
        PHOTON_TRANSFER,
        APERTURE,
        PLATFORM,
        VIRTUAL_IMAGE,
    )
}

__all__ = [
    "APERTURE",
    "APPROXIMATE_BORESIGHT",
    "APPROXIMATE_ORIENTATIONS",
    "APPROXIMATE_POINTS",
    "CAMERAS",
    "CHECK_POINTS",
    "CONTROL_POINTS",
    "CONTROL_RESIDUALS",
    "CORRELATIONS",
    "DEFECT_COLUMNS",
    "DEFECT_PIXELS",
    "DIRECT_GEOREFERENCING",
    "DIRECT_GEOREFERENCING_MODELS",
    "DISTANCES",
    "DISTANCE_RESIDUALS",
    "EDGES",
    "EDGE_DRIFT",
    "EDGE_MEANS",
    "EDGE_RESPONSES",
    "EXPOSURES",
    "EXTERIOR_ORIENTATIONS",
    "FILM_ORIENTATIONS",
    "IMAGES",
    "IMAGE_POINTS",
    "MODEL_ALTERNATIVES",
    "MODEL_ALTERNATIVE_EFFECTS",
    "NEIGHBOURING_IMAGES",
    "NOISE_LEVELS",
    "OBJECT_POINTS",
    "ORIENTATION_DIFFERENCES",
    "ORIENTATION_DIFFERENCE_MEANS",
    "PARAMETERS",
    "PARAMETER_INFLUENCES",
    "PHOTON_TRANSFER",
    "PLATFORM",
    "QUALITY_DRIFT",
    "RESIDUALS",
    "RESIDUAL_AUTOCORRELATION",
    "RESIDUAL_GRID",
    "SCHEMAS",
    "SELF_CALIBRATION",
    "SENSOR_SHEETS",
    "SMEARS",
    "SMEAR_MOTION",
    "STEREO_MODELS",
    "STRIP_ERRORS",
    "SWEEP",
    "TRAJECTORIES",
    "TRUST_MAP_CELLS",
    "VIRTUAL_IMAGE",
    "Y_PARALLAXES",
    "Column",
    "ColumnType",
    "TableSchema",
]
