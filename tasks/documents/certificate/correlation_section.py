"""Section of the correlations, from the covariance matrix of the record."""

from __future__ import annotations

import numpy as np
import pandas as pd

from adjust.arrays import Floats
from tasks.calibration.record import CalibratedParameter, CalibrationRecord
from tasks.document_kit import palette
from tasks.document_kit.row_table import number_of, table_of, text_of
from tasks.document_kit.table import Number, Table
from tasks.documents.certificate import quantities
from tasks.documents.certificate.content import (
    Block,
    Coefficient,
    CorrelationMatrix,
    Figure,
    Listing,
    Section,
    Words,
)
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.report.correlations import matrix_plot
from tasks.quantities import is_additional

#: A page is not wide enough for more.
MOST_IN_MATRIX = 16
#: Above this a correlation is listed.
LEAST_LISTED = 0.5
MOST_LISTED = 30
# From here on the ground is so dark that print on it is white.
_DARK = 0.6


def correlation_section(material: CertificateMaterial) -> Section:
    """The matrix of the system parameters, and the strongest correlations of all."""
    estimated = _ordered(material)
    blocks: list[Block] = []
    if len(estimated) < 2:
        blocks.append(Words("Fewer than two parameters were estimated: there are no correlations."))
        return Section("correlations", "Correlations", tuple(blocks))
    matrix = correlation_of(material.record)
    places = [material.record.estimated.index(item) for item in estimated]
    ordered = matrix[np.ix_(places, places)]
    shown = [index for index, item in enumerate(estimated) if not is_additional(item.parameter)]
    shown = (shown or list(range(len(estimated))))[:MOST_IN_MATRIX]
    names = _names(estimated)
    if len(shown) > 1:
        block = _matrix(ordered[np.ix_(shown, shown)], [names[i] for i in shown], len(estimated))
        blocks.append(block)
    if len(shown) < len(estimated):
        blocks.append(_map(ordered, estimated))
    strongest = strongest_table(ordered, names)
    if strongest.rows:
        blocks.append(Listing(strongest))
    return Section("correlations", "Correlations", tuple(blocks))


def _ordered(material: CertificateMaterial) -> tuple[CalibratedParameter, ...]:
    """The estimated parameters but those of single strips, in the order of the certificate."""
    own = {item.key for item in material.parameters}
    return quantities.in_order(tuple(item for item in material.record.estimated if item.key in own))


def correlation_of(record: CalibrationRecord) -> Floats:
    """(k, k) correlation matrix of the estimated parameters of a record, in their order."""
    covariance = record.covariance_matrix
    sigma = np.sqrt(np.diagonal(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = covariance / np.outer(sigma, sigma)
    return np.asarray(np.clip(np.nan_to_num(correlation), -1.0, 1.0))


def _names(estimated: tuple[CalibratedParameter, ...]) -> list[str]:
    """Short names, with the entity where one name stands for several."""
    short = [quantities.short_name(item) for item in estimated]
    return [
        name if short.count(name) == 1 else f"{name} ({item.entity})"
        for name, item in zip(short, estimated, strict=True)
    ]


def _map(values: Floats, estimated: tuple[CalibratedParameter, ...]) -> Figure:
    """All correlations as colours."""
    names = pd.Index([(quantities.short_name(item), item.entity) for item in estimated])
    words = f"Correlations of all {len(names)} estimated parameters"
    drawing = matrix_plot(pd.DataFrame(values, index=names, columns=names), words)
    caption = f"{words}; the coefficients are computed from the covariance matrix of the record."
    return Figure("correlations", caption, words, drawing, 0.85)


def _matrix(values: Floats, labels: list[str], count: int) -> CorrelationMatrix:
    note = "The record contains the full covariance matrix"
    note += f" of all {count} estimated parameters." if count > len(labels) else "."
    rows = tuple(tuple(_coefficient(float(values[i, j])) for j in range(i)) for i in range(len(labels)))
    return CorrelationMatrix(
        "correlation-matrix", "Correlations of the calibrated parameters", tuple(labels), rows, note
    )


def _coefficient(value: float) -> Coefficient:
    return Coefficient(value, str(Number(value, 2)), palette.signed(value), abs(value) > _DARK)


def strongest_table(correlation: Floats, names: list[str]) -> Table:
    """The pairs that are correlated most, the strongest first."""
    first, second = np.tril_indices(len(names), -1)
    size = np.abs(correlation[first, second])
    chosen = [int(i) for i in np.argsort(-size, kind="stable") if size[i] >= LEAST_LISTED]
    rows = [
        {
            "first": names[second[i]],
            "second": names[first[i]],
            "correlation": correlation[first[i], second[i]],
        }
        for i in chosen[:MOST_LISTED]
    ]
    shown = (
        text_of("first", "parameter"),
        text_of("second", "and"),
        number_of("correlation", "correlation", decimals=3, plus=True),
    )
    note = "" if len(chosen) <= MOST_LISTED else f"The {MOST_LISTED} strongest of {len(chosen)}."
    caption = f"Correlations from {LEAST_LISTED:g} on"
    return table_of("strongest-correlations", caption, shown, rows, "{first}|{second}", note)
