"""Settings of observations of a type that another installed package adds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import AfterValidator, Field

from adjust.extensions import Extended, trouble_of_function
from tasks.settings.base import InputPath, Settings, one_of

#: What makes observations of a type, by its name; see `tasks.block.assembled_block` for its signature.
OBSERVATION_TYPES: Extended[object] = Extended("observations", {}, trouble_of_function)


class OwnObservationsInput(Settings):
    """Observations of a type that an installed package adds."""

    type: Annotated[str, AfterValidator(one_of(OBSERVATION_TYPES, "observation type"))]
    """Name of the type, as the package offers it in its entry points `aerocal.observations`
    ([how](library.md#your-own-observations-parameters-and-formats)).
    """
    file: InputPath
    """The file with the observations; the package states its format."""
    options: Mapping[str, bool | int | float | str] = Field(default={})
    """Values required by the package."""
