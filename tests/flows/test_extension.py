"""An installed package adds observations, a set of parameters and a format, which project files use."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from adjust.extensions import installed_extensions
from flows.runs.project_run import RunOutcome, RunRequest, carry_out
from flows.stories.aerial_triangulation import aerial_triangulation
from tasks.store.stage_key import library_versions
from tests.command_line import aerocal
from tests.conftest import REPOSITORY

SIGMA_M = 0.004


def _forget() -> None:
    installed_extensions.cache_clear()
    library_versions.cache_clear()


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of installed packages with the extension of the examples."""
    folder = tmp_path_factory.mktemp("extension")
    shutil.copytree(REPOSITORY / "examples" / "extension", folder / "source")
    words = "install --quiet --no-deps --no-build-isolation --no-index --disable-pip-version-check --target"
    command = [sys.executable, "-m", "pip", *words.split(), str(folder / "site"), str(folder / "source")]
    subprocess.run(command, check=True)
    return folder / "site"


@pytest.fixture
def installed(built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The same, to be changed by the test, where this process imports from."""
    site = shutil.copytree(built, tmp_path / "site")
    monkeypatch.syspath_prepend(str(site))
    _forget()
    yield site
    _forget()
    for name in [name for name in sys.modules if name.partition(".")[0] == "lake_survey"]:
        del sys.modules[name]


def add(project: Path, *replacements: tuple[str, str]) -> None:
    text = project.read_text()
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    project.write_text(text)


def with_lake(project: Path) -> pd.Series:
    """Declare the parameters of film, control points as text, and water levels of three points; these."""
    folder = project.parent
    control = pd.read_csv(folder / "control.csv")
    rows = [f"{p}; {x}; {y}; {z}  # {role}" for p, x, y, z, role in control.itertuples(index=False)]
    (folder / "control.txt").write_text("# the lake\n" + "\n".join(rows) + "\n")
    found = pd.read_parquet(folder / "results" / "object_points.parquet")
    levels = found[~found["point"].isin(control["point"])].set_index("point")["z_m"].iloc[10:13].round(2)
    levels.rename("level").to_csv(folder / "gauge.csv")
    add(
        project,
        ('file = "control.csv"\nformat = "csv"', 'file = "control.txt"\nformat = "lake-txt"'),
        (
            'rejection = "none"',
            'rejection = "none"\nself_calibration = { parameters = "film" }\n'
            '[[adjustment.own_observations]]\ntype = "water-levels"\nfile = "gauge.csv"\n'
            f"options = {{ sigma_m = {SIGMA_M} }}",
        ),
        ("[gates]\nsigma0 = { min = 0.7, max = 1.3 }", ""),
    )
    return levels


def adjusted(project: Path) -> RunOutcome:
    return carry_out(aerial_triangulation, RunRequest(project))


def test_a_project_uses_everything_that_the_package_adds(installed: Path, warm_block: Path) -> None:  # noqa: ARG001
    levels = with_lake(warm_block)
    outcome = adjusted(warm_block)
    assert outcome.error is None, outcome.error
    results = outcome.directory
    residuals = pd.read_parquet(results / "residuals.parquet")
    own = residuals[residuals["group"] == "water_levels"]
    assert sorted(own["point"]) == sorted(levels.index)
    # adjusted = observed + residual; all of them stand in tables like those of the program itself.
    heights = pd.read_parquet(results / "object_points.parquet").set_index("point")["z_m"]
    found = own.set_index("point")["residual"] + levels
    np.testing.assert_allclose(found[levels.index], heights[levels.index], atol=1e-6)
    assert (own["redundancy"] > 0).all()
    parameters = pd.read_parquet(results / "parameters.parquet").set_index("parameter")
    assert {"film:scale", "film:shear"} <= set(parameters.index)
    assert outcome.summary.sigma0 == pytest.approx(1.0, abs=0.1)
    control = residuals[residuals["group"] == "control_points"]
    assert control["point"].nunique() == 5
    report = (results / "report.html").read_text()
    assert "water levels" in report
    versions = json.loads((results / "manifest.json").read_text())["versions"]
    assert "extension lake-survey 0.1.0" in versions


def test_a_changed_extension_computes_again(installed: Path) -> None:
    before = library_versions()["extension lake-survey 0.1.0"]
    source = installed / "lake_survey" / "film.py"
    source.write_text(source.read_text() + "\n# changed\n")
    _forget()
    assert library_versions()["extension lake-survey 0.1.0"] != before


@pytest.mark.parametrize(
    ("file", "damage", "says"),
    [
        ("gauge.csv", (".", "low"), "gauge.csv:2: The level is not a number. Write point,level."),
        ("control.txt", ("; ", ", "), "control.txt:2: This is not NAME; EAST; NORTH; HEIGHT."),
        ("project.toml", ("sigma_m = 0.004", "sigma = 1"), "Water levels need a standard deviation."),
        ("project.toml", ('"water-levels"', '"water-level"'), "There is no observation type 'water-level'"),
        ("project.toml", ('"film"', '"flim"'), "'flim'"),
    ],
)
def test_a_mistake_in_its_input_is_one_message(
    installed: Path,  # noqa: ARG001
    warm_block: Path,
    file: str,
    damage: tuple[str, ...],
    says: str,
) -> None:
    with_lake(warm_block)
    path = warm_block.parent / file
    path.write_text(path.read_text().replace(*damage))
    done = aerocal("run", warm_block)
    assert done.returncode == 2, done.stderr
    assert says in done.stderr


def test_one_that_cannot_be_loaded_is_named_with_its_package(installed: Path, warm_block: Path) -> None:
    with_lake(warm_block)
    (installed / "lake_survey" / "lake_text.py").write_text("import no_such_library\n")
    done = aerocal("run", warm_block)
    assert done.returncode == 2
    assert "The extension 'lake-txt' (control_points) of the package lake-survey 0.1.0 cannot be loaded:" in (
        done.stderr
    )
    assert "No module named 'no_such_library'" in done.stderr


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("csv", "has a name that aerocal uses itself"),
        ("lake-txt", "is also added by"),
    ],
)
def test_a_name_that_is_taken_is_refused(installed: Path, warm_block: Path, name: str, says: str) -> None:
    metadata = installed / "rival-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: rival\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(f"[aerocal.control_points]\n{name} = rival:read\n")
    _forget()
    with_lake(warm_block)
    done = aerocal("run", warm_block)
    assert done.returncode == 2
    assert says in done.stderr
