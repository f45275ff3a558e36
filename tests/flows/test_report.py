"""The report of a block: every number is that of the artifacts, whatever the block is like."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from base64 import b64encode
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flows.runs.project_run import RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tests.flows import expected_residuals
from tests.tasks.documents.report.page_reader import Page

REPOSITORY = Path(__file__).resolve().parents[2]
#: Ground sampling distance for 1 m of flying height in the block of these tests: 5 µm / 50 mm.
GSD_PER_HEIGHT = 1e-4
Expected = dict[tuple[str, str, str], float | None]


@dataclass(frozen=True)
class Reported:
    """A finished run: its folder, its page, its figures."""

    folder: Path

    @cached_property
    def html(self) -> str:
        return (self.folder / "report.html").read_text(encoding="utf-8")

    @cached_property
    def page(self) -> Page:
        return Page(self.html)

    @cached_property
    def summary(self) -> dict[str, object]:
        content = json.loads((self.folder / "summary.json").read_text())
        assert isinstance(content, dict)
        return content

    def table(self, name: str) -> pd.DataFrame:
        return pd.read_parquet(self.folder / f"{name}.parquet")


def run(project: Path, *overrides: str) -> Reported:
    out = project.parent / "results"
    outcome = carry_out(aerial_triangulation, RunRequest(project, out, overrides))
    assert outcome.error is None, outcome.error
    return Reported(out)


def change(project: Path, name: str, old: str, new: str) -> None:
    file = project.parent / name
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def with_gross_errors(project: Path, count: int, pixels: float = 15.0) -> None:
    """Shift every so-manieth image point by `pixels` along its column."""
    file = project.parent / "image_points.csv"
    points = pd.read_csv(file, dtype={"image": str, "point": str})
    rays = points.groupby("point")["image"].transform("size")
    chosen = points.index[rays >= 4][:: max(1, int((rays >= 4).sum() / count))][:count]
    assert len(chosen) == count
    points.loc[chosen, "x"] += pixels
    points.to_csv(file, index=False)


# What the tables must say, computed from the published files alone.


def expected(reported: Reported) -> Expected:
    parts = (
        key_figures,
        groups,
        surveyed,
        check_points_tested,
        orientations,
        object_points,
        parameters,
        datum,
        residuals,
        model_tests,
        suspicious,
        lists,
    )
    return {key: value for part in parts for key, value in part(reported)}


Item = tuple[tuple[str, str, str], float | None]


def images_of(reported: Reported) -> pd.DataFrame:
    images = reported.table("images").merge(reported.table("exterior_orientations"), on="image")
    images["gsd"] = images["height_above_ground_m"] * GSD_PER_HEIGHT
    return images


def key_figures(reported: Reported) -> Iterator[Item]:
    summary = reported.summary
    counts, images = summary["counts"], images_of(reported)
    single = {
        name: summary[name] for name in ("sigma0", "sigma0_um", "sigma0_px", "redundancy", "iterations")
    }
    single |= {name: summary[name] for name in ("critical_value", "sigma_scaled_by")}
    single |= {name: counts[name] for name in ("images", "object_points", "image_points", "rejected")}
    single |= {name: counts[name] for name in ("control", "check")}
    single |= {"sigma_absolute_um": summary["sigma0_um"]}
    of_rays = next(group["sigma0"] for group in summary["groups"] if group["group"] == "image_points")
    single |= {"sigma_relative_um": of_rays * summary["sigma0_um"] / summary["sigma0"]}
    control = reported.table("control_residuals")
    for name, table in (
        ("control", control[control["status"] == "used"]),
        ("check", reported.table("check_points")),
    ):
        single |= {f"rays_{name}": table["rays"].mean()}
    single |= {"gsd_m": images["gsd"].median(), "height_m": images["height_above_ground_m"].median()}
    for name, value in single.items():
        yield ("key-figures", name, "value_0"), value
    for name, size in (("image_rms_px", 2), ("rmse_control_m", 3), ("rmse_check_m", 3)):
        values = summary[name] or [None] * size
        for index in range(size):
            yield ("key-figures", name, f"value_{index}"), values[index]


def check_points_tested(reported: Reported) -> Iterator[Item]:
    """Found figures from check_points.parquet; limits from summary.json."""
    test, table = reported.summary["check_point_test"], reported.table("check_points")
    if test is None:
        return
    for k, (way, axis) in enumerate((("east", "dx"), ("north", "dy"), ("up", "dz"))):
        d = table[f"{axis}_m"].to_numpy(np.float64)
        rms, predicted = np.sqrt(np.mean(d**2)), np.sqrt(np.mean(table[f"sigma_{axis}_m"] ** 2))
        figures = {"points": float(len(d)), "rms": rms, "predicted": predicted, "mean": d.mean()}
        figures |= {"ratio": rms / predicted, "degrees": test["degrees_of_freedom"][k]}
        figures |= {"low": test["predicted_low_m"][k], "high": test["predicted_high_m"][k]}
        for column, value in (figures | {"mean_limit": test["mean_limit_m"][k]}).items():
            yield ("check-point-test", way, column), float(value)


def groups(reported: Reported) -> Iterator[Item]:
    residuals = reported.table("residuals")
    for group in reported.summary["groups"]:
        own = residuals[residuals["group"] == group["group"]]
        yield ("groups", group["group"], "observations"), float(own["redundancy"].notna().sum())
        yield ("groups", group["group"], "redundancy"), float(own["redundancy"].sum())
        yield ("groups", group["group"], "sigma0"), group["sigma0"]
        yield ("groups", group["group"], "uncontrolled"), float((own["status"] == "uncontrolled").sum())
        rejected = own[own["status"] == "rejected"].drop_duplicates(["image", "point"])
        yield ("groups", group["group"], "rejected"), float(len(rejected))
    for gate in reported.summary["gates"]:
        key = f"{gate['name']}:{gate['bound']}"
        yield ("gates", key, "value"), gate["value"]
        yield ("gates", key, "limit"), gate["limit"]


def surveyed(reported: Reported) -> Iterator[Item]:
    gsd = images_of(reported).set_index("image")["gsd"]
    points = reported.table("image_points")
    points["gsd"] = points["image"].map(gsd)
    for table, name, kind in (
        ("control_residuals", "control-points", "control"),
        ("check_points", "check-points", "check"),
    ):
        found = reported.table(table)
        found["gsd"] = found["point"].map(points.groupby("point")["gsd"].median())
        for row in found.to_dict("records"):
            yield (name, row["point"], "rays"), row["rays"]
            for axis in ("dx", "dy", "dz"):
                d, sigma = row[f"{axis}_m"], row[f"sigma_{axis}_m"]
                yield (name, row["point"], f"{axis}_m"), d
                yield (name, row["point"], f"sigma_{axis}_m"), sigma
                yield (name, row["point"], f"{axis}_gsd"), d / row["gsd"]
                yield (name, row["point"], f"{axis}_ratio"), abs(d) / sigma
            if kind == "control":
                for axis in ("dx", "dy", "dz"):
                    yield (name, row["point"], f"loo_{axis}_m"), row[f"loo_{axis}_m"]
                ratios = [
                    abs(row[f"loo_{axis}_m"]) / row[f"sigma_loo_{axis}_m"] for axis in ("dx", "dy", "dz")
                ]
                yield (name, row["point"], "loo_largest"), max(ratios)
        if len(found) == 0:
            continue
        yield from surveyed_statistics(kind, found, "")
        if kind == "control":
            yield from surveyed_statistics("left-out", found, "loo_")


def surveyed_statistics(kind: str, found: pd.DataFrame, prefix: str) -> Iterator[Item]:
    for axis in ("dx", "dy", "dz"):
        metres = found[f"{prefix}{axis}_m"]
        for unit, d in (("m", metres), ("gsd", metres / found["gsd"])):
            yield ("surveyed-statistics", f"{kind}:rms", f"{axis}_{unit}"), float(np.sqrt((d**2).mean()))
            yield ("surveyed-statistics", f"{kind}:mean", f"{axis}_{unit}"), d.mean()
            yield ("surveyed-statistics", f"{kind}:largest", f"{axis}_{unit}"), d.abs().max()
        for figure in ("rms", "mean", "largest"):
            number = float(metres.notna().sum())
            yield ("surveyed-statistics", f"{kind}:{figure}", f"{axis}_count"), number


def orientations(reported: Reported) -> Iterator[Item]:
    table = reported.table("exterior_orientations")
    for name in (
        "sigma_x_m",
        "sigma_y_m",
        "sigma_z_m",
        "sigma_omega_deg",
        "sigma_phi_deg",
        "sigma_kappa_deg",
    ):
        values = table[name] * (1000.0 if name.endswith("deg") else 1.0)
        for figure in ("min", "median", "max"):
            yield ("orientation-sigmas", name, figure), getattr(values, figure)()


def lists(reported: Reported) -> Iterator[Item]:
    residuals = reported.table("residuals")
    yield from expected_residuals.worst(residuals)
    yield from expected_residuals.lists(residuals, images_of(reported).sort_values("image"))
    yield from expected_residuals.neighbours(reported.table("neighbouring_images"))
    yield from expected_residuals.orientations(reported.table("exterior_orientations"))


def object_points(reported: Reported) -> Iterator[Item]:
    table = reported.table("object_points")
    table["class"] = table["rays"].clip(upper=10).astype(str)
    for key, own in [*table.groupby("class"), ("all", table)]:
        yield ("point-sigmas", key, "points"), float(len(own))
        for axis in ("x", "y", "z"):
            yield ("point-sigmas", key, f"median_{axis}_m"), own[f"sigma_{axis}_m"].median()
            yield ("point-sigmas", key, f"max_{axis}_m"), own[f"sigma_{axis}_m"].max()


def parameters(reported: Reported) -> Iterator[Item]:
    table = reported.table("parameters")
    for row in table[table["sigma"].notna()].to_dict("records"):
        for column in ("value", "sigma", "change", "t", "sigma_prior"):
            value = row[column]
            key = f"{row['parameter']}@{row['entity']}"
            yield ("parameters", key, column), None if np.isnan(value) else value


def datum(reported: Reported) -> Iterator[Item]:
    held = {name for item in reported.summary["datum"] for name in item["held_by"]}
    for item in reported.summary["datum"]:
        factor = 1.0 if item["direction"].startswith("shift") else 1e6
        if item["direction"].startswith("rotation"):
            factor = 1000.0 * 180.0 / np.pi
        sigma = None if item["sigma"] is None else item["sigma"] * factor
        yield ("datum", item["direction"], "sigma"), sigma
        for name in held:
            share = item["held_by"].get(name)
            yield ("datum", item["direction"], name), None if share is None else 100.0 * share


def residuals(reported: Reported) -> Iterator[Item]:
    table = reported.table("residuals")
    rays = table[(table["group"] == "image_points") & table["status"].isin(["used", "uncontrolled"])]
    both = rays.pivot_table(index=["image", "point"], columns="component", values="residual").dropna()
    yield ("image-residuals", "C", "image_points"), float(len(both))
    for axis in ("x", "y"):
        rms = float(np.sqrt((both[axis] ** 2).mean()))
        yield ("image-residuals", "C", f"rms_{axis}_um"), rms
        yield ("image-residuals", "C", f"rms_{axis}_px"), rms / 5.0
    yield from sub_areas(reported)
    for group, own in table[table["status"] == "used"].groupby(
        expected_residuals.observation_group_of(table)
    ):
        w = own["standardized"].dropna()
        if len(w) == 0:
            continue
        yield ("standardized-residuals", group, "count"), float(len(w))
        yield ("standardized-residuals", group, "mean"), w.mean()
        yield ("standardized-residuals", group, "rms"), float(np.sqrt((w**2).mean()))
        yield ("standardized-residuals", group, "largest"), w.abs().max()
        for level in (1.96, 2.58, 3.29, 4.13):
            yield ("standardized-residuals", group, f"beyond_{level}"), 100.0 * (w.abs() > level).mean()


def sub_areas(reported: Reported) -> Iterator[Item]:
    grid = reported.table("residual_grid")
    known = grid[grid["p_value"].notna()]
    yield ("image-residuals", "C", "cells"), float(len(known))
    yield ("image-residuals", "C", "significant"), float(grid["significant"].sum())
    yield ("image-residuals", "C", "by_chance"), 0.05 * len(known)
    lengths = np.hypot(known["mean_vx_um"].fillna(0.0), known["mean_vy_um"].fillna(0.0))
    yield ("image-residuals", "C", "largest_um"), lengths.max() if len(known) else None
    iteration = reported.summary["residual_grid"]["iteration"]
    if iteration is None:
        return
    for step in iteration["steps"]:
        key = str(step["number"])
        for name in ("sigma0", "rms_um", "noise_um"):
            yield ("grid-iteration", key, name), step[name]
    for step in iteration["cross_validation"]:
        key = str(step["number"])
        yield ("grid-iteration", key, "other_rms_um"), step["mean_rms_um"]
        if step["number"] > iteration["taken"]:
            for name in ("sigma0", "rms_um", "noise_um"):
                yield ("grid-iteration", key, name), None
    for step in (*iteration["steps"], *iteration["cross_validation"]):
        yield ("grid-iteration", str(step["number"]), "number"), float(step["number"])


def model_tests(reported: Reported) -> Iterator[Item]:
    """Both tables are cut; every row that is shown is one of the artifact."""
    factors = {"mm": 1e3, "s": 1e3, "1": 100.0}
    for row in reported.table("model_alternatives").to_dict("records"):
        key = "|".join(str(row[name]) for name in ("quantity", "entity", "scope", "part"))
        factor, named = factors.get(row["unit"], 1.0), row["rank"] > 0
        sizes = ("explained", "explained_sigma") if named else ("estimate", "sigma")
        for column, name in zip(("estimate", "sigma"), sizes, strict=True):
            yield ("model-alternatives", key, column), row[name] * factor
        yield ("model-alternatives", key, "t"), row[sizes[0]] / row[sizes[1]]
        yield ("model-alternatives", key, "moved_by"), row["moved_by_estimate"]
        yield ("unnoticed-errors", key, "detectable"), row["detectable"] * factor
        yield ("unnoticed-errors", key, "moved_by"), row["moved_by_detectable"]


def suspicious(reported: Reported) -> Iterator[Item]:
    table = reported.table("residuals")
    texts = table[["group", "image", "point", "component"]].astype(object).where(lambda t: t.notna(), "")
    table["key"] = texts.agg("|".join, axis=1)
    rejected = table[table["status"] == "rejected"]
    for row in rejected.assign(ratio=(rejected["residual"] / rejected["sigma"]).abs()).to_dict("records"):
        for column in ("residual", "sigma", "ratio"):
            yield ("rejected", row["key"], column), row[column]
    others = table[(table["status"] == "uncontrolled") & (table["group"] != "image_points")]
    for row in others.to_dict("records"):
        yield ("uncontrolled", row["key"], "redundancy"), row["redundancy"]
    rays = table[(table["group"] == "image_points") & table["status"].isin(["used", "uncontrolled"])]
    for image, own in rays.groupby("image"):
        few = float((own["status"] == "uncontrolled").sum())
        if few:
            yield ("uncontrolled-images", image, "uncontrolled"), few
            yield ("uncontrolled-images", image, "coordinates"), float(len(own))
            yield ("uncontrolled-images", image, "share"), 100.0 * few / len(own)


def require_equal(reported: Reported) -> int:
    """Compare every number of every table with the artifacts; returns how many were compared."""
    page, wanted = reported.page, expected(reported)
    compared = 0
    for name, table in page.tables.items():
        for (key, column), cell in table.numbers.items():
            if (name, key) == ("standardized-residuals", "expected"):
                continue
            value = wanted[name, key, column]
            if value is None or np.isnan(value):
                assert (cell.data, cell.shown) == ("", "–"), (name, key, column)
            else:
                assert math.isclose(float(cell.data), value, rel_tol=1e-9, abs_tol=1e-12), (name, key, column)
                require_rounded(cell.data, cell.shown)
            compared += 1
    shown = {(name, *place) for name, table in page.tables.items() for place in table.numbers}
    missing = {key for key in wanted if key not in shown}
    cut = {"rejected", "uncontrolled", "uncontrolled-images", "control-points", "check-points"}
    cut |= {"model-alternatives", "unnoticed-errors"}
    assert not {key for key in missing if key[0] not in cut}
    return compared


SECTIONS = (
    "Problems and remarks",
    "Key figures",
    "The block",
    "Image residuals",
    "Control and check points",
    "Exterior orientations",
    "Object points",
    "System parameters",
    "What fixes the datum",
    "Tests of the model",
    "Residuals, rejected and uncontrolled observations",
    "Settings and origin",
)


def require_rounded(data: str, shown: str) -> None:
    """The digits shown are those of the full value."""
    plain = shown.replace(",", "").replace("−", "-").replace("+", "")
    decimals = len(plain.partition(".")[2])
    assert abs(float(plain) - float(data)) <= 0.5 * 10.0**-decimals * (1 + 1e-9), (data, shown)


def test_every_number_in_the_tables_is_that_of_the_artifacts(warm_block: Path) -> None:
    reported = run(warm_block)
    assert require_equal(reported) > 200
    assert reported.summary["counts"]["control"] == 4
    assert set(reported.page.tables) >= {"check-points", "control-points", "gates", "parameters", "settings"}


def test_corrections_by_mean_residuals_are_those_of_the_artifacts(warm_block: Path) -> None:
    reported = run(warm_block, "adjustment.residual_grid.iterations=2", "adjustment.residual_grid.cells=4")
    require_equal(reported)
    assert "grid-iteration" in reported.page.tables
    assert "No further correction" in reported.page.text


def test_no_symbol_of_the_map_hides_the_name_of_a_strip(warm_block: Path) -> None:
    page = run(warm_block).html
    assert 'class="strip-names"' in page
    assert page.rindex('class="strip"') < page.index('class="surveyed"') < page.index('class="strip-names"')


def test_problems_stand_first_and_the_verdict_is_one_sentence(warm_block: Path) -> None:
    reported = run(warm_block, "gates.sigma0.max=0.8")
    text = reported.page.text
    assert "but 1 of 2 limits failed (σ0)" in text
    # The navigation names the sections before they come.
    headings = [text.index(words, text.index("Problems and remarks")) for words in SECTIONS]
    assert headings == sorted(headings)
    problems = reported.summary["problems"]
    assert problems
    assert all(headings[0] < text.index(sentence) < headings[1] for sentence in problems)


def test_no_table_repeats_the_heading_of_its_section(warm_block: Path) -> None:
    html = run(warm_block).html
    headings, captions = (set(re.findall(rf"<{tag}[^>]*>(.*?)</{tag}>", html)) for tag in ("h2", "caption"))
    assert "Key figures" in headings
    assert len(captions) > 20
    assert not headings & captions


def test_the_page_needs_nothing_from_outside_and_allows_its_own_script_only(warm_block: Path) -> None:
    reported = run(warm_block)
    page = reported.page
    assert not {"link", "img", "iframe", "object"} & set(page.tags)
    (script,) = re.findall(r"<script>(.*?)</script>", reported.html, re.DOTALL)
    digest = b64encode(sha256(script.encode()).digest()).decode()
    assert f"default-src 'none'; script-src 'sha256-{digest}';" in reported.html
    assert script == (REPOSITORY / "tasks/documents/report/templates/lists.js").read_text(encoding="utf-8")
    references = [value for _, name, value in page.attributes if name in {"href", "src", "xlink:href"}]
    assert references
    assert all(value.startswith("#") for value in references)
    anchors = {value for _, name, value in page.attributes if name == "id"}
    assert {value[1:] for value in references} <= anchors


def test_the_page_names_no_folder_and_no_time(warm_block: Path) -> None:
    html = run(warm_block).html
    assert str(warm_block.parent) not in html
    assert "run_before" not in html
    assert not re.search(r"\b20\d\d-\d\d-\d\d\b|\b\d\d:\d\d:\d\d\b", html)


def test_another_process_elsewhere_with_another_order_of_sets_gives_the_same_bytes(
    block: Path, run_before: Path
) -> None:
    page = Reported(run_before / "results").html
    out = block.parent / "results-elsewhere"
    command = [sys.executable, "-m", "flows.command", "run", str(block), "--out", str(out)]
    done = subprocess.run(
        command,
        cwd=REPOSITORY,
        env={**os.environ, "PYTHONHASHSEED": "2" if os.environ.get("PYTHONHASHSEED") == "1" else "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert (out / "report.html").read_text(encoding="utf-8") == page


def test_names_from_files_cannot_become_markup(warm_block: Path) -> None:
    nasty = "<script>alert('1')</script>&"
    change(warm_block, "image_points.csv", "1_001,", f"{nasty},")
    change(warm_block, "exposures.csv", "1_001,C,1,", f"{nasty},C,'><img src=x>,")
    control = pd.read_csv(warm_block.parent / "control.csv")["point"].tolist()
    for name in ("image_points.csv", "control.csv"):
        file = warm_block.parent / name
        file.write_text(re.sub(rf"\b{control[1]}\b", "<b>point</b>", file.read_text()))
    change(warm_block, "project.toml", '"two strips"', "'</title><script>\"two\"</script> strips'")
    reported = run(warm_block)
    page = reported.page
    assert "img" not in page.tags
    assert page.tags.count("script") == 1
    assert set(page.tags) & {"b"} == {"b"}
    assert "<b>point</b>" not in reported.html
    assert "<b>point</b>" in page.tables["control-points"].keys
    assert nasty in page.text
    assert '</title><script>"two"</script> strips' in page.text
    assert "'><img src=x>" in page.text
    require_equal(reported)


def without_control(block: Path) -> None:
    head, _, tail = (block.parent / "project.toml").read_text().partition("[inputs.control]")
    (block.parent / "project.toml").write_text(head + "[adjustment]" + tail.partition("[adjustment]")[2])


def test_a_block_without_control_says_none(warm_block: Path) -> None:
    without_control(warm_block)
    reported = run(warm_block)
    require_equal(reported)
    assert "Check points: none." in reported.page.text
    assert "Control points: none were used" in reported.page.text
    assert "surveyed-statistics" not in reported.page.tables


def test_control_without_check_points_does_not_pass_for_accuracy(warm_block: Path) -> None:
    change(warm_block, "control.csv", ",check", ",control")
    reported = run(warm_block)
    require_equal(reported)
    assert "check-points" not in reported.page.tables
    assert "There is no independent evidence of the accuracy of the block" in reported.page.text
    assert len(reported.page.tables["control-points"].keys) == 5


def test_control_of_which_no_image_shows_a_point_is_named_first(warm_block: Path) -> None:
    """Other names in the survey: the residuals agree, and nothing ties the block to the ground."""
    change(warm_block, "control.csv", "\np", "\nP0")
    reported = run(warm_block)
    box = re.sub(r"<[^>]+>", " ", reported.html.partition("<body>")[2].partition("<nav>")[0])
    first = " ".join(box.split())
    assert "Look at the delivery. 5 of 5 control and check points are not measured in any image" in first
    assert "none of 5 surveyed points was used" in first
    assert "but one thing contradicts the rest" in first


def test_control_that_is_not_observed_stands_among_the_check_points(warm_block: Path) -> None:
    reported = run(warm_block, 'adjustment.observe=["gnss", "ins"]')
    require_equal(reported)
    assert len(reported.page.tables["check-points"].keys) == 5
    assert "control-points" not in reported.page.tables
    assert reported.html.count("<title>check point ") == 5


def test_the_first_screen_names_flight_and_version_and_the_figures_of_check_points(warm_block: Path) -> None:
    reported = run(warm_block, 'project.flown="2026-05-24"')
    summary = json.loads((reported.folder / "summary.json").read_text())
    first = re.sub(r"<[^>]+>", " ", reported.html.partition("<body>")[2].partition("<nav>")[0])
    assert f"flown 2026-05-24 · aerocal {version('aerocal')}" in first
    x, y, z = summary["rmse_check_m"]
    assert f"{x:.3f} {y:.3f} {z:.3f} m" in first
    assert summary["counts"]["check"] == 1
    assert "RMS at 1 check point: east, north, up" in first
    groups = {group["group"]: group["sigma0"] for group in summary["groups"]}
    assert f"σ0 by group: image points {groups['image_points']:.2f}, " in first
    assert f"GNSS positions {groups['gnss_positions']:.2f}" in first


def test_a_block_without_ins_has_no_such_group(warm_block: Path) -> None:
    reported = run(warm_block, 'adjustment.observe=["gnss", "control"]', "adjustment.free=[]")
    require_equal(reported)
    assert "ins_attitudes" not in reported.page.tables["groups"].keys
    assert "None were estimated." in reported.page.text
    assert "Self-calibration" not in reported.page.text
    assert "self-calibration" not in reported.page.tables


def test_a_camera_without_images_gets_no_residual_plot(warm_block: Path) -> None:
    text = (warm_block.parent / "project.toml").read_text()
    own = text.partition("[cameras.C]")[2].partition("[inputs")[0]
    change(warm_block, "project.toml", "[inputs.image_points]", f"[cameras.D]{own}[inputs.image_points]")
    reported = run(warm_block)
    require_equal(reported)
    assert reported.page.tables["image-residuals"].keys == ["C"]


@pytest.mark.parametrize(("count", "critical_value"), [(0, 6.0), (6, 4.13), (90, 3.29)])
def test_rejected_observations_are_listed_the_largest_first(
    warm_block: Path, count: int, critical_value: float
) -> None:
    if count:
        with_gross_errors(warm_block, count)
    reported = run(warm_block, f"adjustment.rejection.critical_value={critical_value}", "gates.sigma0.max=9")
    require_equal(reported)
    found = int((reported.table("residuals")["status"] == "rejected").sum())
    assert found >= 2 * min(count, 30)
    if not found:
        assert "Rejected: none." in reported.page.text
        return
    table = reported.page.tables["rejected"]
    ratios = [float(table.numbers[key, "ratio"].data) for key in table.keys]
    assert ratios == sorted(ratios, reverse=True)
    assert len(ratios) == min(found, 60)
    assert (f"largest of {found:,}" in reported.page.text) == (found > 60)


def test_a_block_of_two_images_has_a_report(warm_block: Path) -> None:
    for name in ("exposures.csv", "image_points.csv"):
        file = warm_block.parent / name
        lines = file.read_text().splitlines()
        kept = [lines[0], *(line for line in lines[1:] if line.startswith(("1_001", "1_002")))]
        file.write_text("\n".join(kept) + "\n")
    without_control(warm_block)
    reported = run(warm_block, "adjustment.free=[]", "gates.sigma0.max=3", "gates.sigma0.min=0.1")
    require_equal(reported)
    assert reported.page.tables["key-figures"].numbers["images", "value_0"].shown == "2"
    assert reported.page.tables["point-sigmas"].keys == ["2", "all"]
