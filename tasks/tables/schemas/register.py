"""All tables by their names, in the order in which they are documented."""

from __future__ import annotations

from tasks.tables.schemas import (
    adjustment,
    deliveries,
    film,
    georeferencing,
    image_quality,
    model_tests,
    parameters,
    platform,
    residual_grid,
    sweep,
    trust_map,
    two_step,
)
from tasks.tables.schemas.columns import TableSchema

_SUBJECTS = (
    deliveries,
    film,
    adjustment,
    parameters,
    model_tests,
    two_step,
    sweep,
    residual_grid,
    trust_map,
    georeferencing,
    image_quality,
    platform,
)

#: Every table of every subject.
SCHEMAS: dict[str, TableSchema] = {
    schema.name: schema
    for subject in _SUBJECTS
    for schema in vars(subject).values()
    if isinstance(schema, TableSchema)
}
