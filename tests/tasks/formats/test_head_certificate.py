"""Certificates of heads as data: their unit, what was eliminated, and what their decisions rest on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tasks.deliveries.cameras import camera_record
from tasks.deliveries.head_certificates import about_head_certificates, stated_covariance
from tasks.errors import InputError
from tasks.formats.head_certificate import HeadCertificate, read_head_certificate
from tasks.settings.base import Settings
from tasks.settings.cameras import CameraInput
from tests.tasks.formats.printed_certificates import PAN, PRINTED, RED, certificate

HEADS = tuple(PRINTED)


def read(folder: Path, text: str) -> HeadCertificate:
    path = folder / "certificate.toml"
    path.write_text(text)
    return read_head_certificate(path)


def camera(folder: Path, text: str, **values: object) -> CameraInput:
    path = folder / "certificate.toml"
    path.write_text(text)
    given = {"head_certificate": path, "pixel_origin": "corner", "mount_deg": 0, **values}
    return CameraInput.model_validate({"identity": {"product": "camera_head"}, **given})


@pytest.mark.parametrize("serial", HEADS)
def test_metres_under_the_heading_mm_are_recognised(serial: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'cannot be in mm: .* They are in m.*Write unit = "m"') as error:
        read(tmp_path, certificate(serial))
    assert "K1 shifts a point in the corner by" in str(error.value)
    assert "sum of mm and these numbers is also wrong" in str(error.value)
    found = read(tmp_path, certificate(serial, "m"))
    nominal = 0.120 if serial in PAN else 0.025
    assert found.camera.focal_length_mm == pytest.approx(1e3 * (nominal + PRINTED[serial]["dc"][0]))  # type: ignore[operator]


def test_a_lens_of_the_protocol_is_some_tenths_of_a_millimetre_off_its_nominal_length(tmp_path: Path) -> None:
    """Printed is 119.9996842 mm."""
    assert read(tmp_path, certificate("00110011", "m")).camera.focal_length_mm == pytest.approx(119.6842)
    assert read(tmp_path, certificate(RED, "m")).camera.focal_length_mm == pytest.approx(24.96826)


def test_millimetres_under_the_heading_m_are_recognised_too(tmp_path: Path) -> None:
    values = {"dxp": [-0.2706, 0.01186], "dc": [-0.3158, 0.001424], "K1": [6.164e-7, 2.1e-8]}
    others = {
        "dyp": [0.1016, 0.0072],
        "K2": [-3.653e-10, 8e-12],
        "P1": [-8e-7, 2.7e-7],
        "P2": [8.8e-7, 1.4e-7],
    }
    text = certificate("00110011", "m", **values, **others)
    with pytest.raises(InputError, match=r"cannot be in m: .* They are in mm"):
        read(tmp_path, text)
    in_mm = read(tmp_path, text.replace('unit = "m"', 'unit = "mm"'))
    in_m = read(tmp_path, certificate("00110011", "m"))
    assert in_mm.names == in_m.names
    np.testing.assert_allclose(in_mm.values, in_m.values, rtol=0.02)


def test_numbers_that_are_no_lens_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="do not describe a lens in either unit"):
        read(tmp_path, certificate("00110011", "m", K1=[1e9, 1.0]))


@pytest.mark.parametrize("serial", HEADS)
def test_every_printed_decision_follows_from_its_numbers(serial: str, tmp_path: Path) -> None:
    found = read(tmp_path, certificate(serial, "m"))
    eliminated = [name for name, item in PRINTED[serial].items() if item == "eliminated"]
    assert list(found.eliminated) == eliminated
    assert set(found.names) | set(eliminated) == set(PRINTED[serial])
    # That one was printed without decisions.
    assert list(found.insignificant) == (["P1", "P2"] if serial == RED else [])


def test_what_was_eliminated_is_held_and_not_known_to_be_zero(tmp_path: Path) -> None:
    printed = certificate("00110011", "m", K3=[0.0, 1e-31], b1=[0.0, 1e-31])
    found, again = read(tmp_path, printed), read(tmp_path, certificate("00110011", "m"))
    assert found.eliminated == again.eliminated == ("K3", "b1")
    np.testing.assert_array_equal(found.covariance, again.covariance)
    assert "brown:K3" not in found.camera.additional_parameters
    with pytest.raises(InputError, match="nothing is known to"):
        read(tmp_path, certificate("00110011", "m", K3=[1.0, 1e-31]))


def test_standard_deviations_become_a_covariance_in_units_of_the_tables(tmp_path: Path) -> None:
    text = certificate("00110011", "m") + '\n[correlations]\n"K1 K2" = -0.9\n'
    known = stated_covariance(camera(tmp_path, text, calibration_use="prior"))
    assert known is not None
    sigma = dict(zip(known.parameters, np.sqrt(np.diagonal(known.covariance)), strict=True))
    assert sigma["focal_length"] == pytest.approx(1.424e-3)  # mm
    assert sigma["principal_point_y"] == pytest.approx(7.201e-3)
    assert sigma["brown:K1"] == pytest.approx(2.083e-2)
    assert "brown:K3" not in sigma
    one, other = (known.parameters.index(f"brown:{name}") for name in ("K1", "K2"))
    assert known.covariance[one][other] == pytest.approx(-0.9 * 2.083e-2 * 7.988)
    assert stated_covariance(camera(tmp_path, text, calibration_use="held")) is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('"K1 K9" = 0.5', "not a pair of estimated parameters"),
        ('"K1 K3" = 0.5', "not a pair of estimated parameters"),
        ('"K1 K2" = 1.5', "lies between"),
        ('"K1 K2" = 0.99\n"K1 P1" = 0.99\n"K2 P1" = -0.99', "contradict each other"),
    ],
)
def test_correlations_that_are_none_are_refused(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, certificate("00110011", "m") + f"\n[correlations]\n{text}\n")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"K9": [1.0, 1.0]}, "'K9' is not known"),
        ({"K1": [1.0]}, "a value with its standard deviation"),
        ({"K1": "significant"}, "a value with its standard deviation"),
        ({"K1": [1.0, -1.0]}, "is invalid"),
    ],
)
def test_damaged_parameters_are_refused(change: dict[str, object], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, certificate("00110011", "m", **change))


def test_it_is_never_applied_to_a_composed_image(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="must not be applied"):
        camera(tmp_path, certificate("00110011", "m"), identity={"product": "virtual_image"})
    with pytest.raises(ValueError, match="Keep only one of the two"):
        camera(tmp_path, certificate("00110011", "m"), focal_length_mm=120.0)


@pytest.mark.parametrize(
    ("printed", "declared", "message"),
    [
        ('band = "MS-Red"', {"band": "MS-Green"}, "of band MS-Red, and the camera of MS-Green"),
        ('band = "MS-Red"', {}, "declares the band MS-Red, and the camera does not"),
        ("", {"software": "5.1"}, "declares the software version 5.1, and the certificate does not"),
        ('software = "4.0"', {"software": "5.1"}, "of software version 4.0, and the camera of 5.1"),
        ("band = 3", {"band": "3"}, "band is not a text"),
    ],
)
def test_another_band_or_software_version_is_refused(
    printed: str, declared: dict[str, str], message: str, tmp_path: Path
) -> None:
    text = certificate("00110011", "m").replace("[head]", f"[head]\n{printed}")
    own = camera(tmp_path, text, identity={"product": "camera_head", **declared})
    with pytest.raises(InputError, match=message):
        camera_record(own)


def test_band_and_software_that_are_the_same_are_applied(tmp_path: Path) -> None:
    text = certificate("00110011", "m").replace("[head]", '[head]\nband = "PAN1"\nsoftware = "5.1"')
    identity = {"product": "camera_head", "band": "PAN1", "software": "5.1"}
    assert camera_record(camera(tmp_path, text, identity=identity)).columns == 7168


def test_the_project_says_what_the_certificate_says(tmp_path: Path) -> None:
    red = camera(tmp_path, certificate(RED, "m"))
    assert isinstance(red, Settings)
    used, weak = about_head_certificates({"red": red})
    assert "10 parameters of the certificate of head 00114304" in used
    assert "P1 (0.1 σ), P2 (1.5 σ): a test would eliminate them" in weak
    record = camera_record(red)
    assert record.additional_parameters["brown:K1"] == -138.6
    assert (record.columns, record.rows) == (3072, 2048)
