"""The verdict of a check in one sentence."""

from __future__ import annotations

from tasks.documents.georeferencing.material import CheckMaterial
from tasks.documents.report.figures import gate_words
from tasks.documents.report.key_figures import Verdict


def verdict(material: CheckMaterial) -> Verdict:
    """The result at independent points, whether it was expected, and the limits."""
    found, expected = _differences(material)
    gates = material.summary.gates
    failed = [gate_words(gate.name) for gate in gates if not gate.passed]
    if failed:
        return Verdict("failed", f"{found} Not met: {'; '.join(failed)}.")
    kept = "All limits are met." if gates else "No limits are set in the project."
    return Verdict("good" if expected else "attention", f"{found} {kept}")


def _differences(material: CheckMaterial) -> tuple[str, bool]:
    """The differences in words, and whether they agree with the prediction."""
    figures = material.figures
    if figures.count == 0:
        return "Direct georeferencing was not tested: there are no independent check points.", False
    rmse = ", ".join(f"{value:.3f}" if value is not None else "–" for value in figures.rmse_m)
    words = (
        f"With direct georeferencing, {figures.count} independent check points differ from their survey by "
        f"{rmse} m (RMS east, north, up)"
    )
    too_large = [
        rms is not None and high is not None and rms > high
        for rms, high in zip(figures.rmse_m, figures.predicted_high_m, strict=True)
    ]
    if any(too_large):
        return f"{words}, more than expected from the stated σ.", False
    return f"{words}, as expected from the stated σ.", True
