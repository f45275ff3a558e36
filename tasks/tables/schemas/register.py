"""All tables by their names, in the order in which they are documented."""

from __future__ import annotations

from tasks.tables.schemas import (
    adjustment,
    calibration,
    deliveries,
    georeferencing,
    image_quality,
    model_tests,
    parameters,
    residual_grid,
    sweep,
    trust_map,
)
from tasks.tables.schemas.columns import TableSchema

_SUBJECTS = (
    deliveries,
    adjustment,
    parameters,
    model_tests,
    calibration,
    sweep,
    residual_grid,
    trust_map,
    georeferencing,
    image_quality,
)

#: Every table of every subject.
SCHEMAS: dict[str, TableSchema] = {
    schema.name: schema
    for subject in _SUBJECTS
    for schema in vars(subject).values()
    if isinstance(schema, TableSchema)
}
