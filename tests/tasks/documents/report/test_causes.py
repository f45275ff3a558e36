"""Where the report says to look first, from small tables with one mistake each."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest
from markupsafe import Markup

from tasks.document_kit.table import Row, Table
from tasks.documents.report.causes import by_place, causes, remarks
from tasks.documents.report.first_screen import cards, places, ring_id
from tasks.documents.report.key_figures import verdict
from tasks.documents.report.material import Material
from tasks.documents.report.system_parameters import parameter_table
from tasks.files.json_text import JSON
from tasks.remarks.adjustment import global_test_words, misfit_words, rejected_control_words
from tasks.results.figures import GlobalTestFigure, GroupFigure
from tasks.results.summary import summary_of
from tasks.settings.project import Project
from tasks.settings.quality import Gates
from tasks.store.notes import Notes

NOTHING = pd.DataFrame()
IMAGES = [f"{strip}{k}" for strip in "AB" for k in range(5)]
TABLES = {
    name: Table(name, "", (), tuple(Row(key, ()) for key in keys))
    for name, keys in {
        "control-points": ("1", "2", "3"),
        "check-points": (),
        "image-list": IMAGES,
        "strip-list": "AB",
        "strip-direct-list": "AB",
    }.items()
}


def _residuals(rejected: dict[tuple[str, str], float], points: int = 10) -> pd.DataFrame:
    """Positions and points of ten images in two strips, and three control points.

    Parameters
    ----------
    rejected : by group and name, the residual of the observation.
    """
    rows: list[dict[str, object]] = []
    names = [
        *(("gnss_positions", image, None, "m") for image in IMAGES),
        *(("control_points", None, point, "m") for point in ("1", "2", "3")),
        *(("image_points", image, f"p{k}", "um") for image in IMAGES for k in range(points)),
    ]
    for group, image, point, unit in names:
        for component in "xy":
            name = f"{image}:{point}" if group == "image_points" else str(image or point)
            out = (group, name) in rejected
            rows.append(
                {
                    "group": group,
                    "image": image,
                    "point": point,
                    "component": component,
                    "residual": rejected.get((group, name), 0.01),
                    "sigma": 0.05,
                    "unit": unit,
                    "redundancy": 0.6,
                    "standardized": np.nan if out else 0.3,
                    "status": "rejected" if out else "used",
                }
            )
    return pd.DataFrame(rows)


def _material(
    residuals: pd.DataFrame,
    figures: dict[str, JSON] | None = None,
    problems: tuple[str, ...] = (),
    suspicions: tuple[str, ...] = (),
) -> Material:
    test: dict[str, JSON] = {"lower": 0.98, "upper": 1.02, "confidence": 0.95, "passed": True}
    known: dict[str, JSON] = {"sigma0": 1.0, "critical_value": 4.13, "global_test": test, **(figures or {})}
    images = pd.DataFrame(
        {
            "image": IMAGES,
            "camera": "C",
            "flight": "1",
            "strip": [image[0] for image in IMAGES],
            "x_m": 0.0,
            "z_m": 900.0,
            "height_above_ground_m": 800.0,
        }
    )
    nothing = dict.fromkeys(
        (
            "camera_table",
            "image_points",
            "control_points",
            "parameters",
            "correlations",
            "control_residuals",
            "check_points",
            "distance_residuals",
            "model_alternatives",
            "residual_grid",
            "residual_autocorrelation",
            "self_calibration",
        ),
        NOTHING,
    )
    summary = summary_of([Notes(problems, known)], Gates(), {})
    material = Material(
        project=Project.model_construct(),
        summary=summary,
        cameras={},
        images=images,
        object_points=pd.DataFrame({"z_m": [0.0]}),
        residuals=residuals,
        suspicions=suspicions,
        **nothing,
    )
    # The ground sampling distance needs a camera, which is of no matter here.
    vars(material)["oriented"] = images
    return material


def _finding(sentence: str, **changes: object) -> dict[str, JSON]:
    found: dict[str, JSON] = {
        "rank": 1, "quantity": "gnss_shift", "entity": "1", "scope": "strip", "part": "A", "t": 9.0,
        "moves": "", "moved_by": 0.0, "sentence": sentence,
    }  # fmt: skip
    return found | changes  # type: ignore[operator]


def test_a_sound_block_has_no_cause() -> None:
    assert causes(_material(_residuals({}))) == ()


def test_a_rejected_strip_is_one_cause_with_the_sign_of_tables_and_map() -> None:
    strip = {("gnss_positions", f"A{k}"): -0.3 for k in range(4)}
    (found,) = causes(_material(_residuals(strip)))
    assert found.place == "strip A"
    assert "4 of its 5 GNSS positions were rejected" in found.sentence
    assert "computed − given: x −0.3, y −0.3 m" in found.sentence


def test_two_rejected_positions_of_a_strip_are_two_images_the_larger_first() -> None:
    both = {("gnss_positions", "A1"): -0.3, ("gnss_positions", "A3"): 0.9}
    found = causes(_material(_residuals(both)))
    assert [cause.place for cause in found] == ["image A3", "image A1"]


def test_a_rejected_control_point_is_named_and_its_remark_is_not_repeated() -> None:
    own = rejected_control_words(["2"])
    material = _material(_residuals({("control_points", "2"): 0.3}), problems=(own, "Something else."))
    found = causes(material)
    assert [cause.place for cause in found] == ["control point 2"]
    assert "6.0 times its stated σ" in found[0].sentence
    assert remarks(material, found) == ("Something else.",)
    assert verdict(material, found).tone == "attention"


def test_what_a_finding_explains_is_said_once() -> None:
    group: dict[str, JSON] = {
        "group": "gnss_positions", "observations": 30, "redundancy": 20.0, "sigma0": 2.0,
    }  # fmt: skip
    test: dict[str, JSON] = {"lower": 0.98, "upper": 1.02, "confidence": 0.95, "passed": False}
    said = (
        "The strip is shifted.",
        global_test_words(1.1, GlobalTestFigure(lower=0.98, upper=1.02, confidence=0.95, passed=False)),
        str(misfit_words(GroupFigure(group="gnss_positions", observations=30, redundancy=20.0, sigma0=2.0))),
        "Something else.",
    )
    strip = {("gnss_positions", f"A{k}"): -0.3 for k in range(5)}
    figures: dict[str, JSON] = {
        "sigma0": 1.1,
        "global_test": test,
        "groups": [group],
        "model_findings": [_finding("The strip is shifted.")],
    }
    material = _material(_residuals(strip), figures, said)
    found = causes(material)
    assert [cause.place for cause in found] == ["strip A"]
    assert remarks(material, found) == ("Something else.",)


def test_a_group_that_fits_badly_without_a_cause_stays_among_the_remarks() -> None:
    figure = GroupFigure(group="gnss_positions", observations=30, redundancy=20.0, sigma0=2.0)
    words = misfit_words(figure)
    assert words is not None
    material = _material(_residuals({}), {"groups": [figure.to_json()]}, (words,))
    assert remarks(material, causes(material)) == (words,)


@pytest.mark.parametrize(
    ("finding", "place"),
    [
        ({"quantity": "control_point", "entity": "7", "scope": "all", "part": ""}, "control point 7"),
        ({"quantity": "gnss_position", "entity": "B2", "scope": "all", "part": ""}, "image B2"),
        ({"scope": "height", "part": "780 m"}, "the height 780 m"),
        ({"scope": "flight", "part": "1"}, "flight 1"),
        ({"quantity": "control_tilt", "entity": "", "scope": "all", "part": ""}, "the control points"),
        ({"quantity": "convergence", "entity": "", "scope": "all", "part": ""}, "the north of the attitudes"),
        ({"quantity": "lever_arm", "entity": "1", "scope": "all", "part": ""}, "all exposures"),
    ],
)
def test_every_finding_has_a_place(finding: dict[str, object], place: str) -> None:
    found = causes(_material(_residuals({}), {"model_findings": [_finding("Something.", **finding)]}))
    assert [cause.place for cause in found] == [place]


@pytest.mark.parametrize(
    ("entity", "alike", "inseparable", "place"),
    [
        ("2", ("1",), (), "one of the control points 1, 2"),
        ("2", ("1",), ("2", "3"), "one of the control points 1, 2, 3"),
        ("2", (), ("1", "3"), "control point 2"),
    ],
)
def test_control_points_that_cannot_be_told_from_each_other_are_one_place(
    entity: str, alike: tuple[str, ...], inseparable: tuple[str, ...], place: str
) -> None:
    of_all = {"quantity": "control_point", "scope": "all", "part": "", "alike_points": alike}
    findings = [_finding("It is too high.", entity=entity, **of_all)]
    figures: dict[str, JSON] = {"model_findings": findings, "inseparable_control": inseparable}
    found = causes(_material(_residuals({}), figures))
    assert [cause.place for cause in found] == [place]
    (named,), _ = places(_material(_residuals({})), found, TABLES, Markup(""))
    assert named.links == (("table", f"control-points-row-{found[0].points[0]}"),)


@pytest.mark.parametrize(("number", "named"), [(4, False), (5, True)])
def test_an_image_of_which_much_was_rejected_is_named(number: int, named: bool) -> None:
    points = {("image_points", f"B1:p{k}"): 9.0 for k in range(number)}
    found = causes(_material(_residuals(points, points=20)))
    assert [cause.place for cause in found] == (["image B1"] if named else [])
    if named:
        assert "5 of its 20 image points were rejected" in found[0].sentence


def test_without_rejection_residuals_tell_the_image() -> None:
    residuals = _residuals({})
    wrong = (residuals["group"] == "image_points") & (residuals["image"] == "A2")
    residuals.loc[wrong & (residuals["component"] == "x"), "standardized"] = 6.0
    (found,) = causes(_material(residuals, {"critical_value": None}))
    assert found.place == "image A2"
    assert "10 of its 10 image points have significant residuals" in found.sentence


def test_a_suspicion_is_a_cause_and_never_green() -> None:
    material = _material(
        _residuals({}), problems=("The heights look wrong.",), suspicions=("The heights look wrong.",)
    )
    found = causes(material)
    assert [cause.place for cause in found] == ["the delivery"]
    assert remarks(material, found) == ()
    assert verdict(material, found).tone == "attention"


def test_the_first_screen_holds_six_and_says_how_many_more() -> None:
    many = {("gnss_positions", f"{strip}{k}"): 0.3 + 0.1 * k for strip in "AB" for k in range(2)}
    many |= {("control_points", str(k)): 1.0 for k in (1, 2, 3)}
    material = _material(_residuals(many))
    named, _ = places(material, causes(material), TABLES, Markup(""))
    assert len(named) == 6
    assert len(by_place(causes(material))) == 7


def test_a_place_links_to_its_ring_and_to_its_row() -> None:
    material = _material(_residuals({("gnss_positions", "B2"): 0.4, ("control_points", "2"): 1.0}))
    found = causes(material)
    assert [cause.place for cause in found] == ["control point 2", "image B2"]
    assert [ring_id(found, cause) for cause in found] == ["look-1", "look-2"]
    rings = Markup('<circle id="look-2"/>')
    (point, image), tables = places(material, found, TABLES, rings)
    assert point.links == (("table", "control-points-row-2"),)
    assert image.links == (("map", "look-2"), ("table", "image-list-row-8"))
    assert '<tr id="control-points-row-2" data-key="2">' in tables["control-points"].body
    assert tables["control-points"].body.count(" id=") == 1


def test_a_strip_links_to_its_row_of_what_does_not_fit() -> None:
    material = _material(_residuals({("gnss_positions", f"A{k}"): -0.3 for k in range(4)}))
    (strip,), _ = places(material, causes(material), TABLES, Markup(""))
    assert strip.links == (("table", "strip-direct-list-row-1"),)


@pytest.mark.parametrize("explained", [False, True])
def test_a_check_point_beyond_its_sigma_is_named_unless_a_finding_may_have_moved_it(explained: bool) -> None:
    findings: list[JSON] = [_finding("The strip is shifted.")] if explained else []
    material = _material(_residuals({}), {"model_findings": findings})
    checks = pd.DataFrame(
        {
            "point": ["11", "12"],
            **{f"d{axis}_m": [0.02, 0.30 if axis == "z" else 0.02] for axis in "xyz"},
            **{f"sigma_d{axis}_m": [0.03, 0.03] for axis in "xyz"},
            "rays": [4, 4],
        }
    )
    rays = pd.DataFrame({"image": ["A1"], "point": ["11"]})
    material = dataclasses.replace(material, check_points=checks, image_points=rays)
    vars(material)["oriented"] = material.images.assign(gsd_m=0.1)
    found = causes(material)
    assert [cause.place for cause in found] == (["strip A"] if explained else ["check point 12"])
    if not explained:
        assert "dz +0.300 m, 10.0 times its σ" in found[0].sentence


def _with_check_points(material: Material, dx: list[float], dz: list[float]) -> Material:
    """With check points 11, 12, … of these differences, each with a σ of 3 cm."""
    count = len(dx)
    checks = pd.DataFrame(
        {
            "point": [f"{11 + k}" for k in range(count)],
            "dx_m": dx,
            "dy_m": [0.01] * count,
            "dz_m": dz,
            **{f"sigma_d{axis}_m": [0.03] * count for axis in "xyz"},
            "rays": [4] * count,
        }
    )
    rays = pd.DataFrame({"image": ["A1"], "point": ["11"]})
    material = dataclasses.replace(material, check_points=checks, image_points=rays)
    vars(material)["oriented"] = material.images.assign(gsd_m=0.1)
    return material


def _check_point_test(mean: list[float], limit: float, points: int) -> dict[str, JSON]:
    three: list[JSON] = [limit] * 3
    return {
        "points": [points] * 3, "rmse_m": three, "predicted_rmse_m": three, "predicted_low_m": three,
        "predicted_high_m": three, "ratio": three, "degrees_of_freedom": three, "mean_m": list(mean),
        "mean_limit_m": three, "confidence": 0.95, "over_limit": 2.0,
    }  # fmt: skip


def test_check_points_that_differ_alike_are_one_cause_and_none_of_them_is_wrong_by_itself() -> None:
    test = _check_point_test([-0.25, 0.01, 0.3], 0.03, 5)
    shift = [-0.25, -0.24, -0.26, -0.27, -0.23]
    material = _material(_residuals({}), {"check_point_test": test})
    material = _with_check_points(material, shift, [0.3, 0.31, 0.29, 0.3, 0.9])
    common, single = causes(material)
    assert common.place == "the check points"
    assert "computed − given dx −0.250 m, dz +0.300 m" in common.sentence
    assert single.place == "check point 15"
    assert "dz +0.900 m, 20.0 times its σ in addition to what all have in common" in single.sentence


def test_one_wrong_check_point_that_moves_the_mean_is_no_common_cause() -> None:
    test = _check_point_test([0.01, 0.01, 0.2], 0.03, 5)
    material = _material(_residuals({}), {"check_point_test": test})
    material = _with_check_points(material, [0.01] * 5, [0.01, -0.02, 1.0, 0.02, -0.01])
    assert [cause.place for cause in causes(material)] == ["check point 13"]


def test_a_free_network_says_nothing_against_check_points() -> None:
    free: dict[str, JSON] = {"defect": 7, "open": ["scale"], "inner_constraints": "object_points"}
    material = _material(_residuals({}), {"free_network": free})
    assert causes(_with_check_points(material, [9.0] * 3, [9.0] * 3)) == ()


def test_the_first_screen_says_what_a_difference_at_check_points_is_worth() -> None:
    figures: dict[str, JSON] = {"rmse_check_m": [0.01, 0.02, 0.03], "counts": {"check": 1}}
    assert cards(_material(_residuals({}), figures))[2].words == "RMS at 1 check point: east, north, up"
    free: dict[str, JSON] = {"defect": 7, "open": ["scale"], "inner_constraints": "object_points"}
    figures |= {"free_network": free, "counts": {"check": 4}}
    assert cards(_material(_residuals({}), figures))[2].words == (
        "RMS at 4 check points: east, north, up; no accuracy, because the datum is not determined"
    )


@pytest.mark.parametrize(("images", "words"), [(1, "image with 2 image"), (2, "images with 2 image")])
def test_the_first_screen_counts_a_single_image(images: int, words: str) -> None:
    figures: dict[str, JSON] = {"counts": {"images": images, "image_points": 2}}
    assert cards(_material(_residuals({}), figures))[3].words == f"{words} points"


@pytest.mark.parametrize(("dz", "named"), [(0.3, False), (2.0, True)])
def test_a_check_point_is_named_beside_a_single_error_that_cannot_have_moved_it_so_far(
    dz: float, named: bool
) -> None:
    # t = 9 and r = 0.6 move it by 9 √3 √(0.4/0.6) = 12.7 σ at most; it is off by 10 and 67.
    finding = _finding("The position is wrong.", quantity="gnss_position", entity="B2", scope="all", part="")
    material = _material(_residuals({}), {"model_findings": [finding]})
    found = causes(_with_check_points(material, [0.01] * 3, [0.01, dz, 0.01]))
    assert [cause.place for cause in found] == ["image B2", *(["check point 12"] if named else [])]


def test_a_redundancy_above_one_of_correlated_errors_moves_nothing() -> None:
    finding = _finding("The position is wrong.", quantity="gnss_position", entity="B2", scope="all", part="")
    residuals = _residuals({}).assign(redundancy=1.02)
    found = causes(
        _with_check_points(_material(residuals, {"model_findings": [finding]}), [0.0] * 3, [0.0, 0.3, 0.0])
    )
    assert [cause.place for cause in found] == ["image B2", "check point 12"]


def test_residuals_that_are_all_too_large_are_no_mistake_of_any_image() -> None:
    residuals = _residuals({})
    scatter = 8.0 * np.random.default_rng(1).standard_normal(len(residuals))
    residuals["standardized"] = np.where(residuals["group"] == "image_points", scatter, 0.3)
    assert causes(_material(residuals, {"critical_value": None})) == ()


@pytest.mark.parametrize("all_of_them", [False, True])
def test_that_a_group_does_not_fit_is_said_unless_a_few_of_it_explain_it(all_of_them: bool) -> None:
    figure = GroupFigure(group="gnss_positions", observations=30, redundancy=20.0, sigma0=6.5)
    words = str(misfit_words(figure))
    finding = _finding("The position is wrong.", quantity="gnss_position", entity="B2", scope="all", part="")
    residuals = _residuals({})
    positions = residuals["group"] == "gnss_positions"
    residuals.loc[positions & (all_of_them | (residuals["image"] == "B2")), "standardized"] = 6.0
    figures: dict[str, JSON] = {"groups": [figure.to_json()], "model_findings": [finding]}
    material = _material(residuals, figures, (words,))
    assert remarks(material, causes(material)) == ((words,) if all_of_them else ())


def test_what_concerns_one_place_stands_together_and_counts_once() -> None:
    both: list[JSON] = [_finding("It is shifted."), _finding("It is turned.", quantity="boresight", rank=2)]
    material = _material(_residuals({}), {"model_findings": both})
    found = causes(material)
    assert by_place(found) == {"strip A": ("It is shifted.", "It is turned.")}
    assert "one thing contradicts the rest" in verdict(material, found).sentence


@pytest.mark.parametrize("calibrated", [False, True])
def test_the_report_of_a_calibration_says_whose_significance_it_shows(calibrated: bool) -> None:
    columns = ("parameter", "entity", "unit", "status", "value", "sigma", "change", "t", "sigma_prior")
    rows = [("boresight_roll", "C", "deg", "significant", 0.1, 0.01, 0.1, 10.0, np.nan)]
    figures: JSON = {
        "verdict": "accepted", "directions": "", "heights": "", "parameters": [], "releases": [],
    }  # fmt: skip
    material = dataclasses.replace(
        _material(_residuals({}), {"calibration": figures} if calibrated else None),
        parameters=pd.DataFrame(rows, columns=columns),
    )
    note = parameter_table(material).note
    assert ("the certificate tests with its larger σ" in note) == calibrated
