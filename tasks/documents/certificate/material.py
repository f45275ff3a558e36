"""The material of a certificate: the record of the calibration and the tables of its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from tasks.calibration.record import CalibratedParameter, CalibrationRecord
from tasks.documents.georeferencing.material import CheckMaterial, read_check
from tasks.documents.report.material import Material, read_material
from tasks.files.json_text import from_json
from tasks.quantities import is_calibrated
from tasks.settings.certificate import CertificateSettings
from tasks.settings.project import Project, ProjectSource
from tasks.store.artifact import Artifact, verified
from tasks.tables.parquet import read_table

_OF_CHECKS = ("direct_georeferencing", "y_parallaxes", "stereo_models")


@dataclass(frozen=True, eq=False)
class CertificateMaterial:
    """The record and the results it was made from.

    Attributes
    ----------
    record : what is certified.
    results : tables and figures of the adjustment.
    check : those of a direct-georeferencing check with this calibration; None without one.
    exposures : as delivered (exposures.parquet).
    certificate : who calibrates and signs.
    source : the project file.
    """

    record: CalibrationRecord
    results: Material
    check: CheckMaterial | None
    exposures: pd.DataFrame
    certificate: CertificateSettings
    source: ProjectSource

    @cached_property
    def parameters(self) -> tuple[CalibratedParameter, ...]:
        """The parameters of the record without those of single strips, which apply to this flight only."""
        return tuple(item for item in self.record.parameters if is_calibrated(item.parameter))

    @cached_property
    def strip_parameters(self) -> pd.DataFrame:
        """The estimated parameters of single strips (parameters.parquet)."""
        table = self.results.parameters
        return table[~table["parameter"].map(is_calibrated) & table["sigma"].notna()]

    @property
    def images_of_strips(self) -> pd.DataFrame:
        """The `images` of one head alone, so that neighbours in a strip are not of one event."""
        taken = [name for name in self.record.names if (self.images["camera"] == name).any()]
        return self.images[self.images["camera"].isin(taken[:1])]

    @cached_property
    def images(self) -> pd.DataFrame:
        """The adjusted images of the record with ``level``, the index of their height in it."""
        images = self.results.oriented
        images = images[images["camera"].isin(self.record.names)].reset_index(drop=True)
        height = (images["z_m"] - images["ground_m"]).to_numpy(np.float64)
        levels = np.array(self.record.flight.heights_m, dtype=np.float64)
        if len(levels) == 0 or not (levels > 0.0).all():
            return images.assign(level=0)
        # Heights belong to the level that is nearest as a ratio: relief is a part of the height.
        distance = np.abs(np.log(np.maximum(height, 1e-3))[:, None] - np.log(levels)[None, :])
        return images.assign(level=np.argmin(distance, axis=1))


def read_certificate_material(
    record: Artifact,
    stages: Sequence[Mapping[str, Artifact]],
    project: Project,
    certificate: CertificateSettings,
    source: ProjectSource,
) -> CertificateMaterial:
    """Read everything a certificate shows.

    Parameters
    ----------
    record : the file calibration.json.
    stages : the outputs of all stages by name, in the order in which they ran.
    """
    noted = [outputs for outputs in stages if "notes" in outputs]
    tables = {name: artifact for outputs in stages for name, artifact in outputs.items()}
    return CertificateMaterial(
        CalibrationRecord.model_validate(from_json(verified(record).read_text(encoding="utf-8"))),
        read_material(noted, project),
        read_check(noted, project) if tables.keys() >= set(_OF_CHECKS) else None,
        read_table(tables["exposures"]),
        certificate,
        source,
    )
