"""What a certificate says, held against the record and the tables of the results."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tasks.calibration.record import CalibratedParameter
from tasks.document_kit.map_plot import MapPlot
from tasks.documents.certificate.content import CorrelationMatrix, Figure, Section, Sentences
from tasks.documents.certificate.correlation_section import strongest_table
from tasks.documents.certificate.documents import document_of, page_of
from tasks.documents.certificate.flight_section import BESIDE, strip_beside_its_line
from tasks.documents.certificate.parameter_section import conventions_table
from tests.tasks.documents.certificate.conftest import (
    Calibration,
    as_json,
    changed,
    number_in,
    tables_of,
    text_in,
    with_parameter,
)

GON = 10.0 / 9.0


@pytest.fixture(scope="module")
def tables(calibration: Calibration) -> dict[str, dict[str, Any]]:
    return tables_of(as_json(document_of(calibration.content())))


def by_name(calibration: Calibration) -> dict[str, CalibratedParameter]:
    return {item.parameter: item for item in calibration.record.parameters}


def section(calibration: Calibration, name: str, **changes: object) -> Section:
    content = calibration.content(changed(calibration.record, **changes))
    (found,) = [each for each in content.sections if each.name == name]
    return found


def sentences(found: Section, heading: str) -> str:
    return " ".join(
        item
        for b in found.single_blocks
        if isinstance(b, Sentences) and b.heading == heading
        for item in b.items
    )


@pytest.mark.parametrize(
    ("name", "table", "factor", "fine"),
    [
        ("principal_point_x", "interior", 1e3, 1e3),
        ("principal_point_y", "interior", 1e3, 1e3),
        ("boresight_roll", "boresight", 1.0, 1.0),
        ("boresight_yaw", "boresight", 1.0, 1.0),
        ("gnss_shift_z", "gnss-shift", 1.0, 1.0),
    ],
)
def test_values_are_those_of_the_record_in_customary_units(
    calibration: Calibration,
    tables: dict[str, dict[str, Any]],
    name: str,
    table: str,
    factor: float,
    fine: float,
) -> None:
    item = by_name(calibration)[name]
    key = f"{name}@{item.entity}"
    assert item.sigma is not None
    expected = {
        "given": item.given * factor,
        "calibrated": item.value * factor,
        "change": (item.value - item.given) * fine,
        "sigma": item.sigma * fine,
        "t": (item.value - item.given) / item.sigma,
    }
    for column, value in expected.items():
        assert number_in(tables[table], key, column) == pytest.approx(value, rel=1e-12, abs=1e-15)
    words = {"significant": "significant", "not_significant": "not significant"}
    assert text_in(tables[table], key, "finding") == words[item.status]


def test_what_has_no_result_has_neither_value_nor_sigma(tables: dict[str, dict[str, Any]]) -> None:
    lines = [(tables["interior"], "focal_length@UCE-80"), (tables["lever-arm"], "lever_arm_z@UCE-80")]
    for table, key in lines:
        assert text_in(table, key, "finding") == "held"
        for column in ("calibrated", "change", "sigma", "t"):
            assert number_in(table, key, column) is None
    assert number_in(tables["interior"], "focal_length@UCE-80", "given") == 80.0
    additional = tables["additional-parameters"]
    assert text_in(additional, "bluh:1@UCE-80", "finding").startswith("eliminated: |t| = ")
    for column in ("value", "sigma", "t", "effect_max_um"):
        assert number_in(additional, "bluh:1@UCE-80", column) is None
    assert text_in(additional, "bluh:9@UCE-80", "finding") == "significant"


def test_a_zero_with_a_zero_sigma_is_printed_nowhere(calibration: Calibration) -> None:
    for found in as_json(document_of(calibration.content()))["sections"]:
        for block in found["blocks"]:
            for fact in block.get("facts", []):
                _, sign, sigma = fact["shown"].partition("±")
                assert not sign or any(digit in sigma for digit in "123456789"), fact["shown"]


@pytest.mark.parametrize(
    ("verdict", "status"), [("not_determinable", "significant"), ("determined", "prior_only")]
)
def test_what_the_flight_cannot_determine_is_no_result(
    calibration: Calibration, verdict: str, status: str
) -> None:
    because = "one heading does not separate it; fly a strip back"
    record = with_parameter(
        calibration.record,
        "boresight_roll",
        lambda item: item.model_copy(update={"verdict": verdict, "status": status, "because": because}),
    )
    document = as_json(document_of(calibration.content(record)))
    table = tables_of(document)["boresight"]
    assert text_in(table, "boresight_roll@UCE-80", "finding").startswith("not determinable")
    for column in ("calibrated", "change", "sigma", "t"):
        assert number_in(table, "boresight_roll@UCE-80", column) is None
    (brief,) = [each for each in document["sections"] if each["name"] == "brief"]
    facts = {fact["key"]: fact["shown"] for fact in brief["blocks"][0]["facts"]}
    assert facts["boresight_roll@UCE-80"].startswith("not determinable")
    assert "±" in facts["boresight_pitch@UCE-80"]
    assert because in str(document["sections"])


def test_a_weak_parameter_says_so(calibration: Calibration) -> None:
    record = with_parameter(
        calibration.record, "gnss_shift_x", lambda item: item.model_copy(update={"verdict": "weak"})
    )
    table = tables_of(as_json(document_of(calibration.content(record))))["gnss-shift"]
    key = f"gnss_shift_x@{by_name(calibration)['gnss_shift_x'].entity}"
    assert text_in(table, key, "finding") == "significant, weakly determined"


def test_the_misalignment_in_other_conventions_is_that_of_the_conventions_page(
    calibration: Calibration,
) -> None:
    """docs/conventions.md, rotation chain: mounting 270°, image side (0.05, −0.03, 0.10)°."""
    found = dict(zip(("roll", "pitch", "yaw"), (-0.030087, 0.049948, -0.1), strict=True))
    record = calibration.record
    for name, value in found.items():
        record = with_parameter(
            record, f"boresight_{name}", lambda item, v=value: item.model_copy(update={"value": v})
        )
    record = changed(record, camera=record.camera.model_copy(update={"mount_deg": 270}))
    items = [item for item in record.parameters if item.parameter.startswith("boresight")]
    table = conventions_table(calibration.material(record), items)
    rows = {
        row.key: [cell.value for cell in row.cells[2:] if not isinstance(cell, str)] for row in table.rows
    }
    assert rows["body"][:3] == pytest.approx([-0.030087, 0.049948, -0.1], abs=1e-12)
    assert rows["added"][3:] == pytest.approx([-0.030087 * GON, 0.049948 * GON, -0.1 * GON], abs=1e-12)
    assert rows["image_side"][:3] == pytest.approx([0.05, -0.03, 0.10], abs=2e-6)


def test_correlations_are_those_of_the_results(calibration: Calibration) -> None:
    (matrix,) = [b for b in section(calibration, "correlations").blocks if isinstance(b, CorrelationMatrix)]
    table = calibration.table("correlations")
    known = {
        frozenset((row.parameter_a, row.parameter_b)): row.correlation
        for row in table.itertuples()
        if "strip" not in row.parameter_a + row.parameter_b
    }
    names = {
        "x0": "principal_point_x", "y0": "principal_point_y", "boresight roll": "boresight_roll",
        "boresight pitch": "boresight_pitch", "boresight yaw": "boresight_yaw", "shift east": "gnss_shift_x",
        "shift north": "gnss_shift_y", "shift up": "gnss_shift_z",
    }  # fmt: skip
    assert set(matrix.labels) == set(names)
    for index, row in enumerate(matrix.rows):
        assert len(row) == index
        for other, cell in enumerate(row):
            pair = frozenset((names[matrix.labels[index]], names[matrix.labels[other]]))
            assert cell.value == pytest.approx(known[pair], abs=1e-9)
            assert float(cell.shown.replace("−", "-")) == pytest.approx(cell.value, abs=0.005)


def test_all_correlations_are_drawn_where_the_matrix_leaves_additional_parameters_out(
    calibration: Calibration,
) -> None:
    (figure,) = [b for b in section(calibration, "correlations").blocks if isinstance(b, Figure)]
    count = len(calibration.record.estimated)
    assert count == 9
    assert str(figure.drawing).count("<title>") == count * (count - 1) // 2
    found = calibration.record.covariance_matrix
    names = [item.parameter for item in calibration.record.estimated]
    i, j = names.index("bluh:9"), names.index("gnss_shift_z")
    value = found[i, j] / np.sqrt(found[i, i] * found[j, j])
    assert f"bluh:9 of UCE-80 and shift up of 1: {value:+z.3f}" in str(figure.drawing)


def test_the_strongest_correlations_come_first() -> None:
    table = strongest_table(np.array([[1, 0.6, -0.9], [0.6, 1, 0.2], [-0.9, 0.2, 1]]), ["a", "b", "c"])
    assert [row.key for row in table.rows] == ["a|c", "a|b"]


def test_statistics_are_those_of_the_tables(
    calibration: Calibration, tables: dict[str, dict[str, Any]]
) -> None:
    table = tables["statistics"]
    control = calibration.table("control_residuals")
    residuals = calibration.table("residuals")
    orientations = calibration.table("exterior_orientations")
    for axis in "xyz":
        d = control[f"d{axis}_m"].dropna()
        assert number_in(table, "rms_control_m", axis) == pytest.approx((d**2).mean() ** 0.5, rel=1e-12)
        assert number_in(table, "largest_ground_residual_m", axis) == pytest.approx(d.abs().max(), rel=1e-12)
        own = residuals[(residuals["group"] == "gnss_positions") & (residuals["component"] == axis)]
        expected = (own["residual"] ** 2).mean() ** 0.5
        assert number_in(table, "rms_photo_position_m", axis) == pytest.approx(expected, rel=1e-12)
        mean = orientations[f"sigma_{axis}_m"].mean()
        assert number_in(table, "mean_sigma_photo_position_m", axis) == pytest.approx(mean, rel=1e-12)
        mean = calibration.table("object_points")[f"sigma_{axis}_m"].mean()
        assert number_in(table, "mean_sigma_object_points_m", axis) == pytest.approx(mean, rel=1e-12)
    yaw = residuals[(residuals["group"] == "ins_attitudes") & (residuals["component"] == "yaw")]
    expected = (yaw["residual"] ** 2).mean() ** 0.5
    assert number_in(table, "rms_photo_attitude_deg", "z") == pytest.approx(expected, rel=1e-12)
    assert number_in(table, "rms_control_limit_m", "z") == 0.15
    x, y = (number_in(table, "rms_control_m", axis) for axis in "xy")
    assert x is not None
    assert y is not None
    assert number_in(table, "rms_control_m", "xy") == pytest.approx(((x**2 + y**2) / 2) ** 0.5, rel=1e-12)


def test_only_independent_check_points_carry_a_statement(
    calibration: Calibration,
) -> None:
    document = as_json(document_of(calibration.content()))
    tables = tables_of(document)
    assert "not independent" in tables["control-differences"]["caption"]
    check = calibration.table("check_points")
    assert len(check) >= 30
    rms = (check["dz_m"] ** 2).mean() ** 0.5
    assert number_in(tables["check-differences"], "rms", "dz_m") == pytest.approx(rms, rel=1e-12)
    checks = section(calibration, "checks")
    said = sentences(checks, "Statements from the adjustment")
    assert f"({len(check)} check points" in said
    assert "ASPRS" in said
    assert "National Standard" in said
    assert f"{len(check)} check points" in sentences(checks, "Statements from direct georeferencing")
    assert [row["key"] for row in tables["control-points"]["rows"]] == sorted(
        calibration.table("control_residuals")["point"]
    )


def test_a_refused_calibration_is_for_no_use(calibration: Calibration) -> None:
    reasons = ("σ of c is 9.7 µm, allowed 2 µm: fly a second height",)
    content = calibration.content(changed(calibration.record, verdict="refused", reasons=reasons))
    assert content.sentence == f"Not accepted: {reasons[0]}"
    assert content.title == "Calibration not accepted"
    assert "certificate –" not in page_of(content)
    assert calibration.content().title == "Calibration certificate"
    use = section(calibration, "use", verdict="refused", reasons=reasons)
    assert sentences(use, "The values are valid for") == ""
    assert sentences(use, "This certificate must not be used").startswith("For production:")
    assert content.sections[0].name == "reasons"
    assert sentences(content.sections[0], "Not accepted, because") == reasons[0]
    assert calibration.content().sections[0].name == "laboratory"
    assert sentences(section(calibration, "use"), "The values are valid for") != ""


def test_a_restriction_stands_first_and_the_values_may_be_used(calibration: Calibration) -> None:
    said = ("Strip 3 sits otherwise.",)
    content = calibration.content(changed(calibration.record, verdict="restricted", restrictions=said))
    assert content.title == "Calibration certificate with restrictions"
    assert content.sentence == "Accepted with one restriction, which must be observed."
    assert sentences(content.sections[0], "Restrictions of use") == said[0]
    use = section(calibration, "use", verdict="restricted", restrictions=said)
    assert sentences(use, "The values are valid for") != ""
    assert "For production:" not in sentences(use, "This certificate must not be used")


@pytest.mark.parametrize(
    ("product", "words"),
    [("virtual_image", "For single camera heads"), ("camera_head", "For the virtual image")],
)
def test_a_head_and_the_virtual_image_are_kept_apart(
    calibration: Calibration, product: str, words: str
) -> None:
    camera = calibration.record.camera
    identity = camera.identity.model_copy(update={"product": product})
    use = section(calibration, "use", camera=camera.model_copy(update={"identity": identity}))
    assert words in sentences(use, "This certificate must not be used")


def test_the_map_shows_every_strip_and_every_surveyed_point(calibration: Calibration) -> None:
    (figure,) = [b for b in section(calibration, "flight").blocks if isinstance(b, Figure)]
    drawing = str(figure.drawing)
    assert drawing.count('class="flown-strip"') == calibration.table("images")["strip"].nunique()
    assert drawing.count('r="1.5"') == len(calibration.table("images"))
    for point in calibration.table("control_points")["point"]:
        assert f"<title>{point}</title>" in drawing
    legend = drawing.partition('class="legend"')[2]
    assert "check point" in legend


def test_a_line_flown_forward_and_reverse_shows_two_arrows_beside_it(calibration: Calibration) -> None:
    """Two strips on one line with opposite headings are drawn on the two sides of it."""
    images = calibration.material().images
    strip = images[images["strip"] == images["strip"].iloc[0]]
    plot = MapPlot.over(np.array([-3000.0, 3000.0]), np.array([-3000.0, 3000.0]))
    level = strip.assign(y_m=0.0, x_m=np.linspace(-1000.0, 1000.0, len(strip)), heading_deg=90.0)
    forward, reverse = (
        str(strip_beside_its_line(level.assign(heading_deg=h), plot, "#000")) for h in (90.0, 270.0)
    )
    middle = plot.y.at(0.0)
    assert f'cy="{middle + BESIDE:.1f}"' in forward
    assert f'cy="{middle - BESIDE:.1f}"' in reverse


def test_what_no_flight_can_tell_is_an_assumption_with_its_effect(
    calibration: Calibration, tables: dict[str, dict[str, Any]]
) -> None:
    """Half a pixel of the principal point: the other reading of the pixel's origin."""
    half_um = 0.5 * calibration.record.camera.pixel_um
    for item in calibration.record.parameters:
        if item.parameter.startswith("principal_point") and item.sigma is not None:
            key = f"{item.parameter}@{item.entity}"
            assert number_in(tables["assumptions"], key, "change") == half_um
            in_sigma = number_in(tables["assumptions"], key, "in_sigma")
            assert in_sigma == pytest.approx(1e-3 * half_um / item.sigma)
    assert len(tables["assumptions"]["rows"]) == 2  # a local system has one north only
