"""Section of the settings: every choice that affects the numbers, in words."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from tasks.coordinates.crs import MapFrame
from tasks.document_kit.table import Number, decimals_for, numbers
from tasks.documents.certificate.content import Fact, Facts, Section
from tasks.documents.certificate.material import CertificateMaterial
from tasks.quantities import KINDS, unit_words
from tasks.remarks.observation_sigmas import part_words
from tasks.settings.adjustment import AdjustmentSettings

_NONE = "none"
_POSITION = {
    "projection_centre": "reduced to the projection centre",
    "antenna": "of the antenna",
    "imu": "of the inertial unit",
}
_ORDER = {
    "omega-phi-kappa": "ω, φ, κ",
    "phi-omega-kappa": "φ, ω, κ",
    "heading-pitch-roll": "heading, pitch, roll",
}
_REFERENCE = {"grid": "grid north", "true-north": "true north", "local": "the axes of the local system"}
_DATUM = {
    "observations": "by the observations",
    "free_network": "free network, inner constraints on approximate values",
}
_ROBUST = {"huber": "Huber", "cauchy": "Cauchy", "tukey": "Tukey", "biber": "modified M-estimation (BIBER)"}
_ELIMINATION = {
    "default": "default (correlation 0.90, total correlation 0.975, t of 99 %)",
    "bluh": "as BLUH (t below 1, correlations above 0.85)",
    "dmc_certificate": "as the DMC certificates (t below 1.96)",
    "none": _NONE,
}


def settings_section(material: CertificateMaterial) -> Section:
    """Model, weights and tests."""
    return Section(
        "settings",
        "Settings of the calibration",
        (
            Facts("model-settings", "Model", _model(material)),
            Facts("weights", "Standard deviations a priori, and weights", _weights(material)),
            Facts("tests", "Tests and rejection", _tests(material)),
        ),
    )


def _model(material: CertificateMaterial) -> tuple[Fact, ...]:
    project = material.results.project
    settings = project.adjustment
    exposures = project.inputs.exposures
    frame = MapFrame.of(project.project.crs, project.project.heights)
    curvature = (
        "none: the coordinates are Cartesian"
        if frame.is_local
        else "rigorous: adjusted in Cartesian axes at one point of the ellipsoid, results transformed "
        "back to the map; image coordinates are not corrected for it"
    )
    refraction = (
        "corrected with the standard atmosphere (ICAO)"
        if settings.refraction == "standard"
        else "not corrected: the delivered image coordinates are already corrected"
    )
    free = [KINDS[name].words for name in settings.free]
    return (
        Fact("frame", "coordinates", (frame.description,)),
        Fact("curvature", "Earth curvature and map projection", (curvature,)),
        Fact("refraction", "refraction", (refraction,)),
        Fact("estimated", "estimated", tuple(free) or (_NONE,)),
        Fact("additional", "additional parameters", _additional(settings)),
        Fact("positions", "given positions are", _distinct(_POSITION[item.position] for item in exposures)),
        Fact(
            "angles",
            "given angles are",
            _distinct(
                f"{_ORDER[item.angles.order]}, relative to {_REFERENCE[item.angles.reference]}"
                for item in exposures
            ),
        ),
        _lever_arm(material),
        Fact("time_offset", "time offset", _time_offset(material)),
        Fact("datum", "datum", (_DATUM[settings.datum],)),
        Fact("grid", "corrections of the image by mean residuals", _grid(settings)),
    )


def _additional(settings: AdjustmentSettings) -> tuple[str, ...]:
    own = settings.self_calibration
    if own.parameters == "none":
        return (_NONE,)
    return (
        f"{own.parameters}, one set for each {own.per}",
        f"elimination: {_ELIMINATION[own.elimination]}",
    )


def _lever_arm(material: CertificateMaterial) -> Fact:
    """Where the lever arm is held, or that it is estimated."""
    if "lever_arm" in material.results.project.adjustment.free:
        return Fact("lever_arm", "lever arm", ("estimated",))
    values = {item.parameter: item.given for item in material.record.parameters}
    given = material.results.project.cameras[material.record.camera.name].lever_arm_m
    held = numbers((values.get(f"lever_arm_{axis}", given[k]) for k, axis in enumerate("xyz")), 3)
    return Fact("lever_arm", "lever arm forward, right, down, held at", held, "m")


def _time_offset(material: CertificateMaterial) -> tuple[str, ...]:
    project = material.results.project
    if "time_offset" in project.adjustment.free:
        return ("estimated",)
    return (f"held at zero, declared σ = {1e3 * project.calibration.held.time_offset_s:g} ms",)


def _grid(settings: AdjustmentSettings) -> tuple[str, ...]:
    own = settings.residual_grid
    found = [
        *([f"from {len(own.file)} earlier adjustments"] if own.file else []),
        *([f"up to {own.iterations} iterations ({own.method})"] if own.iterations else []),
    ]
    return tuple(found) or (_NONE,)


def _weights(material: CertificateMaterial) -> tuple[Fact, ...]:
    results, camera = material.results, material.record.camera
    settings = results.project.adjustment
    own = material.exposures[material.exposures["camera"].isin(material.record.names)]
    measured = results.image_points[results.image_points["image"].isin(own["image"])]
    control = results.control_points[results.control_points["role"] == "control"]
    scale = 1e3 / camera.pixel_um
    image = [float(measured[f"sigma_{axis}_mm"].median()) for axis in "xy"]
    attitude = _attitude_sigmas(own)
    return (
        Fact("image_um", "image points x, y (median)", numbers((1e3 * v for v in image), 2), "µm"),
        Fact("image_px", "in pixels", numbers((scale * v for v in image), 2), "px"),
        Fact("control_m", "control east, north, up (median)", _medians(control, "sigma_{}_m", "xyz", 3), "m"),
        Fact("gnss_m", "GNSS positions east, north, up (median)", _medians(own, "sigma_{}_m", "xyz", 3), "m"),
        Fact("ins_deg", f"INS attitudes {attitude[0]} (median)", attitude[1], "°"),
        Fact("priors", "σ of initial values", _priors(settings)),
        Fact("gnss_correlation", "correlation time of GNSS errors", _seconds(settings.gnss_correlation_s)),
        Fact("ins_correlation", "correlation time of INS errors", _seconds(settings.ins_correlation_s)),
        Fact("components", "variance components", _components(material)),
        Fact(
            "scaled",
            "standard deviations of results",
            (
                "scaled by σ0 a posteriori"
                if settings.sigma0 == "a_posteriori"
                else "not scaled: the stated σ are taken as known",
            ),
        ),
        Fact(
            "held",
            "parameters held fixed",
            ("included in every σ, see the last table of the calibrated parameters",),
        ),
    )


def _priors(settings: AdjustmentSettings) -> tuple[str, ...]:
    """σ of the initial values of estimated parameters, where there is one."""
    found = []
    for kind in (KINDS[name] for name in settings.free):
        value = getattr(settings.priors, kind.key(kind.unit), None)
        if value is not None:
            found.append(f"{kind.words} {_sizes(value)} {unit_words(kind.unit)}")
    return tuple(found) or (_NONE,)


def _attitude_sigmas(exposures: pd.DataFrame) -> tuple[str, tuple[Number, ...]]:
    """Names of the angles that were given, and the medians of their σ."""
    for words, names in (
        ("roll, pitch, heading", ("roll", "pitch", "heading")),
        ("ω, φ, κ", ("omega", "phi", "kappa")),
    ):
        if exposures[f"sigma_{names[0]}_deg"].notna().any():
            return words, _medians(exposures, "sigma_{}_deg", names, 4)
    return "", (Number(None),)


def _medians(table: pd.DataFrame, pattern: str, names: Sequence[str], decimals: int) -> tuple[Number, ...]:
    medians = (float(table[pattern.format(name)].median()) for name in names)
    return numbers(medians, decimals)


def _sizes(value: float | tuple[float, ...]) -> str:
    parts = value if isinstance(value, tuple) else (value,)
    return " / ".join(f"{part:g}" for part in dict.fromkeys(parts))


def _seconds(value: float | None) -> tuple[str, ...]:
    return ("none: the errors are assumed to be independent",) if value is None else (f"{value:g} s",)


def _components(material: CertificateMaterial) -> tuple[str, ...]:
    """Factors of the stated σ where they were estimated."""
    found = material.results.figures.variance_components
    if found is None:
        return ("not estimated: the stated σ are used",)
    return tuple(
        f"{part_words(item.part)} σ × {item.factor:.{decimals_for(item.factor, 3)}f}"
        + ("" if item.estimated else " (as stated)")
        for item in found.components
    )


def _tests(material: CertificateMaterial) -> tuple[Fact, ...]:
    project = material.results.project
    settings, rejection = project.adjustment, project.adjustment.rejection
    facts = [
        Fact(
            "critical_value",
            "critical value of standardized residuals",
            (Number(rejection.critical_value, 2),),
        )
        if rejection.critical_value is not None
        else Fact("critical_value", "rejection of gross errors", (_NONE,))
    ]
    if rejection.critical_value is not None:
        what = {
            "components": "the largest component of an observation",
            "observations": "all components of an observation together, with the same probability",
        }[rejection.test]
        of = {"a_priori": "σ0 a priori", "a_posteriori": "σ0 a posteriori"}[rejection.reference_variance]
        facts.append(Fact("compared", "tested", (what, of)))
    robust = "Danish method" if rejection.robust == "danish" else _ROBUST.get(rejection.robust or "", _NONE)
    facts += [
        Fact("robust", "robust search for gross errors before the tests", (robust,)),
        Fact("confidence", "confidence of tests", (Number(100.0 * settings.confidence, 0),), "%"),
        Fact(
            "angle",
            "minimum intersection angle of object points",
            (Number(project.checks.min_intersection_angle_deg, 1),),
            "°",
        ),
        Fact("iterations", "maximum number of iterations", (Number(settings.max_iterations),)),
    ]
    return tuple(facts)


def _distinct(texts: object) -> tuple[str, ...]:
    return tuple(dict.fromkeys(texts))  # type: ignore[call-overload]
