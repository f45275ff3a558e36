"""Laboratory, signatures, image axes, exposures and limits as a laboratory signs them."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import date

import numpy as np
import pandas as pd
import pytest

from adjust.camera.interior import nominal_mounting
from tasks.document_kit.table import Number, Row
from tasks.documents.certificate.compose import content_of
from tasks.documents.certificate.content import CertificateContent, Facts, Signatures
from tasks.documents.certificate.coverage import coverage_of
from tasks.documents.certificate.documents import document_of, page_of, pdf_of
from tasks.documents.certificate.flight_section import exposure_table
from tasks.documents.certificate.identity_section import forward_in_image, image_axes
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.certificate.quantities import has_result
from tasks.documents.certificate.verdict_section import limit_table
from tasks.settings.certificate import CertificateSettings, Laboratory, Signatory
from tasks.settings.quality import AxisGate, Gates
from tests.tasks.documents.certificate.conftest import (
    HOSTILE,
    Calibration,
    as_json,
    changed,
    number_in,
    tables_of,
)

SIGNED = CertificateSettings(
    numbers={"UCE-80": "2026-017"},
    calibrated=date(2026, 9, 21),
    issued=date(2026, 9, 28),
    laboratory=Laboratory(name=HOSTILE, address=("Street 1", "Town")),
    signatories=(Signatory(name=HOSTILE, role="Head"), Signatory(name="B", role="In charge")),
)


def content(calibration: Calibration, settings: CertificateSettings, **changes: object) -> CertificateContent:
    material = calibration.material(changed(calibration.record, **changes))
    return content_of(replace(material, certificate=settings), {"typst": "1"})


def facts(found: CertificateContent, name: str) -> dict[str, tuple[str, str]]:
    blocks = [b for s in found.sections for b in s.single_blocks if isinstance(b, Facts) and b.name == name]
    return {fact.key: (fact.label, fact.shown) for block in blocks for fact in block.facts}


def places(found: CertificateContent) -> list[tuple[str, str, str]]:
    (block,) = [b for s in found.sections for b in s.single_blocks if isinstance(b, Signatures)]
    return [(place.role, place.name, place.filled) for place in block.places]


def test_what_the_project_says_is_printed_to_the_letter(calibration: Calibration) -> None:
    found = content(calibration, SIGNED)
    assert facts(found, "laboratory") == {
        "number": ("number of the certificate", "2026-017"),
        "laboratory": ("laboratory", HOSTILE),
        "address": ("address", "Street 1, Town"),
        "accreditation": ("accreditation", ""),
        "calibrated": ("date of calibration", "2026-09-21"),
        "issued": ("date of issue", "2026-09-28"),
    }
    assert places(found) == [
        ("Place, date", "", "2026-09-28"),
        ("Head", HOSTILE, ""),
        ("In charge", "B", ""),
    ]
    assert page_of(found).count('class="blank"') == 3  # accreditation, manufacturer, type
    assert pdf_of(found).startswith(b"%PDF")


def test_what_it_does_not_say_is_left_blank_and_never_invented(calibration: Calibration) -> None:
    found = content(calibration, CertificateSettings())
    assert {shown for _, shown in facts(found, "laboratory").values()} == {""}
    assert places(found)[0] == ("Place, date", "", "")
    assert all(not name and not filled for _, name, filled in places(found))
    assert page_of(found).count('class="blank"') == 6 + 2
    assert b"CreationDate" not in pdf_of(found)


def test_a_refused_calibration_has_a_number_but_none_of_a_certificate(calibration: Calibration) -> None:
    found = content(calibration, SIGNED, verdict="refused", reasons=("a", "b"))
    assert facts(found, "laboratory")["number"] == ("number of the document", "2026-017")


@pytest.mark.parametrize("mount_deg", [0, 90, 180, 270])
def test_the_direction_of_flight_is_that_of_the_mounting(calibration: Calibration, mount_deg: int) -> None:
    """T takes it to the forward axis of the body, a quarter turn clockwise from it to the right one."""
    x, y = forward_in_image(mount_deg)
    mounting = nominal_mounting(mount_deg)
    np.testing.assert_allclose(mounting @ [x, y, 0.0], [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(mounting @ [y, -x, 0.0], [0.0, 1.0, 0.0], atol=1e-12)
    camera = calibration.record.camera
    for size in ((camera.columns, camera.rows), (camera.rows, camera.columns)):
        turned = camera.model_copy(update={"mount_deg": mount_deg, "columns": size[0], "rows": size[1]})
        drawing = str(image_axes(calibration.material(changed(calibration.record, camera=turned))))
        assert_inside(drawing)


def assert_inside(drawing: str) -> None:
    """Every text lies within the drawing, at eight units a letter."""
    size = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', drawing)
    assert size is not None
    width, height = float(size[1]), float(size[2])
    texts = re.findall(r'<text x="([\d.-]+)" y="([\d.-]+)" text-anchor="(\w+)"[^>]*>([^<]*)<', drawing)
    assert len(texts) >= 8
    for x, y, anchor, words in texts:
        long = 8.0 * len(words)
        start = float(x) - {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor] * long
        assert start >= 0.0, words
        assert start + long <= width, words
        assert 12.0 <= float(y) <= height - 4.0, words


def test_the_principal_point_is_drawn_on_its_side(calibration: Calibration) -> None:
    drawing = str(image_axes(calibration.material()))
    values = {item.parameter: 1e3 * item.value for item in calibration.record.parameters}
    x0, y0 = (f"{values[f'principal_point_{axis}']:+z.1f}".replace("-", "−") for axis in "xy")
    assert f"x0 {x0} µm, y0 {y0} µm" in drawing


def test_expanded_uncertainties_are_k_times_sigma(calibration: Calibration) -> None:
    k = coverage_of(calibration.material()).k
    assert k == pytest.approx(1.960, abs=0.005)
    document = as_json(document_of(calibration.content()))
    tables = tables_of(document)
    compared = 0
    for item in calibration.record.estimated:
        for name in ("interior", "boresight", "gnss-shift", "additional-parameters"):
            key = f"{item.parameter}@{item.entity}"
            if has_result(item) and key in {row["key"] for row in tables[name]["rows"]}:
                sigma = number_in(tables[name], key, "sigma")
                assert sigma is not None
                assert number_in(tables[name], key, "expanded") == pytest.approx(k * sigma, rel=1e-12)
                compared += 1
    assert compared >= 8
    (brief,) = [s for s in document["sections"] if s["name"] == "brief"]
    values = {fact["key"]: fact["values"] for fact in brief["blocks"][0]["facts"]}
    roll = next(item for item in calibration.record.parameters if item.parameter == "boresight_roll")
    assert roll.sigma is not None
    assert values["boresight_roll@UCE-80"][1]["value"] == pytest.approx(k * roll.sigma, rel=1e-12)


def counts(material: CertificateMaterial) -> dict[str, tuple[float | None, str]]:
    found = {}
    for row in exposure_table(material).rows:
        assert isinstance(row.cells[1], Number)
        found[row.key] = (row.cells[1].value, str(row.cells[2]))
    return found


def test_exposures_that_take_no_part_are_named_with_their_reason(calibration: Calibration) -> None:
    material = calibration.material()
    names = sorted(material.exposures["image"])
    assert counts(material) == {"delivered": (28, ""), "used": (28, ""), "not_used": (0, "")}
    more = material.exposures.iloc[:2].assign(image=["X-2", "X-1"])
    residuals = material.results.residuals.astype({"status": str})
    of_first = residuals["image"] == names[0]
    residuals.loc[of_first & (residuals["group"] == "gnss_positions"), "status"] = "rejected"
    residuals = residuals[~((residuals["image"] == names[1]) & (residuals["group"] == "ins_attitudes"))]
    changed_ = replace(
        material,
        exposures=pd.concat([material.exposures, more], ignore_index=True),
        results=replace(material.results, residuals=residuals),
    )
    assert counts(changed_) == {
        "delivered": (30, ""),
        "used": (28, ""),
        "not_used": (2, ""),
        "without_points": (2, "X-1, X-2"),
        "gnss_positions_rejected": (1, names[0]),
        "ins_attitudes_missing": (1, names[1]),
    }


def limits(material: CertificateMaterial) -> dict[str, Row]:
    return {row.key: row for row in limit_table(material).rows}


def test_limits_are_kept_or_not_as_their_figures_say(calibration: Calibration) -> None:
    material = calibration.material()
    found = limits(material)
    assert [found[f"sigma0:{name}"].cells[-1] for name in ("image_points", "gnss_positions")] == ["met"] * 2
    gate = found["rmse_control_m_x:max"]
    assert (str(gate.cells[3]), gate.cells[4], gate.cells[5]) == ("0.100", "m", "met")
    assert found["global_test"].cells[-1] == "met"
    # It refuses nothing, so that an accepted calibration has no limit that is simply not met.
    off = material.results.summary.model_copy(update={"sigma0": 1.2})
    failed_test = limits(replace(material, results=replace(material.results, summary=off)))
    assert failed_test["global_test"].cells[-1] == "not met, not decisive"
    residuals = material.results.residuals.astype({"status": str})
    own = residuals.index[residuals["group"] == "gnss_positions"]
    residuals.loc[own[: 3 * 14], "status"] = "rejected"
    summary = material.results.summary
    failed = summary.gates[0].model_copy(update={"value": None, "passed": False})
    worse = replace(
        material,
        results=replace(
            material.results,
            residuals=residuals,
            summary=summary.model_copy(update={"gates": (failed, *summary.gates[1:])}),
        ),
    )
    found = limits(worse)
    part = found["rejected:gnss_positions"].cells[1]
    assert isinstance(part, Number)
    assert part.value == pytest.approx(50.0)
    assert found["rejected:gnss_positions"].cells[-1] == "not met"
    assert found["rejected:image_points"].cells[-1] == "met"
    assert found[f"{failed.name}:max"].cells[-1] == "not met"


def with_groups(material: CertificateMaterial, **groups: dict[str, float] | None) -> CertificateMaterial:
    """With figures of observation groups changed, or without a group."""
    old = material.results.summary
    found = [item.model_dump() | (groups.get(item.group) or {}) for item in material.results.figures.groups]
    found = [item for item in found if groups.get(item["group"], {}) is not None]
    summary = type(old).model_validate({**old.model_dump(), **(old.model_extra or {}), "groups": found})
    return replace(material, results=replace(material.results, summary=summary))


def test_no_limit_is_listed_that_the_verdict_does_not_apply(calibration: Calibration) -> None:
    """An accepted certificate would contradict itself with a limit that is not met."""
    material = calibration.material()
    record = material.record
    estimated, held = "principal_point_x", "focal_length"
    swapped = {estimated: held, held: estimated}
    parameters = tuple(
        item.model_copy(update={"parameter": swapped.get(item.parameter, item.parameter)})
        for item in record.parameters
    )
    flight = record.flight.model_copy(update={"heights_m": (800.0,)})
    one_height = changed(record, parameters=parameters, flight=flight)
    own = replace(material, record=one_height)
    assert {"headings", "height_ratio"} <= limits(own).keys()
    # Without GNSS positions neither directions nor heights are needed.
    without = with_groups(own, gnss_positions=None)
    assert not {"headings", "height_ratio"} & limits(without).keys()
    # Heads that look in different directions determine their focal lengths at one height.
    rig = changed(one_height, heads=(record.camera.model_copy(update={"name": "left"}),))
    assert "height_ratio" not in limits(replace(own, record=rig))
    refused = changed(rig, verdict="refused", reasons=("One height only.",))
    assert limits(replace(own, record=refused))["height_ratio"].cells[-1] == "not met"
    # σ0 of a few redundant observations says little.
    for redundancy, listed in ((29.0, False), (31.0, True)):
        few = with_groups(material, ins_attitudes={"sigma0": 2.0, "redundancy": redundancy})
        assert ("sigma0:ins_attitudes" in limits(few)) is listed
    # One or two rejected ones are single gross errors, whatever part they are of a few.
    residuals = material.results.residuals.astype({"status": str})
    control = residuals.index[residuals["group"] == "control_points"][:9]
    few_points = residuals.drop(residuals.index[residuals["group"] == "control_points"].difference(control))
    for count, listed in ((2, False), (3, True)):
        points = few_points.loc[control, "point"].drop_duplicates()[:count]
        table = few_points.copy()
        table.loc[control.intersection(table.index[table["point"].isin(points)]), "status"] = "rejected"
        found = limits(replace(material, results=replace(material.results, residuals=table)))
        assert ("rejected:control_points" in found) is listed


def test_errors_of_the_model_are_held_against_what_they_may_move(calibration: Calibration) -> None:
    material = calibration.material()
    of = {"entity": "UCE-80", "moved_by": 0.3}
    where = {
        "rank": 1,
        "scope": "all",
        "part": "",
        "t": 5.0,
        "moves": "",
        "sentence": "The boresight differs.",
    }
    finding = {"quantity": "boresight", **of, **where}
    chance = {"strips": 9, "statistic": 40.0, "freedom": 9, "probability": 1e-5, "scatter": 0.002}
    scatter = {"quantity": "boresight_pitch", "unit": "deg", **of, **chance, "moved_by": 1.4}
    found = {"moved_by_findings": 0.4, "model_findings": [finding], "strip_scatter": []}
    for worse, words in (({}, "met"), ({"strip_scatter": [scatter]}, "not met")):
        extra = {**(material.results.summary.model_extra or {}), **found, **worse}
        summary = type(material.results.summary).model_validate(
            {**material.results.summary.model_dump(), **extra}
        )
        row = limits(replace(material, results=replace(material.results, summary=summary)))["model"]
        assert isinstance(row.cells[1], Number)
        assert row.cells[1].value == max(
            0.4, *(item["moved_by"] for item in worse.get("strip_scatter", [])), 0
        )
        assert row.cells[-1] == words


def test_the_limit_of_the_statistics_says_whether_it_is_kept(calibration: Calibration) -> None:
    material = calibration.material()
    gates = Gates(rmse_control_m=AxisGate(max=(1.0, 1.0, 1e-6)))
    project = material.results.project.model_copy(update={"gates": gates})
    for with_gates, words in ((material.results.project, "met"), (project, "not met")):
        results = replace(material.results, project=with_gates)
        tables = tables_of(as_json(document_of(content_of(replace(material, results=results), {}))))
        rows = {row["key"]: row["cells"][-1] for row in tables["statistics"]["rows"]}
        assert rows["rms_control_limit_m"] == words
        assert rows["rms_check_limit_m"] == "none set"


def test_variance_components_are_stated_with_their_factors(calibration: Calibration) -> None:
    material = calibration.material()
    parts = [("gnss_positions plan", 1.0234, True), ("ins_attitudes yaw", 0.9, False)]
    known_to = {"factor_lower": 0.8, "factor_upper": 1.2, "sigma": 0.1, "unit": "m"}
    known_to |= {"redundancy": 90.0, "degrees_of_freedom": 90.0}
    components = [{"part": part, "factor": f, "estimated": known, **known_to} for part, f, known in parts]
    old = material.results.summary
    extra = {
        **(old.model_extra or {}),
        "variance_components": {"rounds": 1, "confidence": 0.95, "components": components},
    }
    summary = type(old).model_validate({**old.model_dump(), **extra})
    found = content_of(replace(material, results=replace(material.results, summary=summary)), {})
    shown = facts(found, "weights")["components"][1]
    assert shown == "GNSS positions in plan σ × 1.02, INS attitudes yaw σ × 0.900 (as stated)"


def test_the_settings_that_act_are_stated(calibration: Calibration) -> None:
    found = content(calibration, CertificateSettings())
    model, weights = facts(found, "model-settings"), facts(found, "weights")
    assert model["curvature"][1].startswith("none: the coordinates are Cartesian")
    assert model["additional"][1].startswith("bluh:1-2+9-11, one set for each camera")
    points = calibration.table("image_points")
    median = 1e3 * points["sigma_x_mm"].median()
    assert weights["image_um"][1] == f"{median:.2f}, {median:.2f} µm"
    assert weights["priors"][1] == "GNSS bias of each strip 0.03 m"
    assert facts(found, "tests")["critical_value"] == ("rejection of gross errors", "none")
