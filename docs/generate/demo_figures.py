"""Numbers of the demonstration in the pages: ``python -m docs.generate.demo_figures``.

Carries out what ``make demo`` does, writes what it prints into README, and the figures in it into the
sentences that state them. A slow test holds README to a run; other tests hold the sentences to README.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from docs.generate.example_figures import ROOT, write_figures

README = ROOT / "README.md"
_SHOWN = re.compile(r"(ends with:\n\n```\n)(.*?)(^```$)", re.DOTALL | re.MULTILINE)
#: Sentences that state figures, as they are in a page; a space may be a line end there.
SENTENCES = (
    (
        "CHANGELOG.md",
        "simulated: c to {focal_length_um:.1f} µm, x0, y0 to {principal_point_um:.1f} µm, roll and pitch to "
        "{roll_pitch_mdeg:.2f}, yaw to {yaw_mdeg:.1f} mdeg, shift to {shift_plan_cm:.1f} and "
        "{shift_up_cm:.1f} cm.",
    ),
    (
        "CHANGELOG.md",
        "Simulated flight of the published calibration: RMS {rms_x:.3f}, {rms_y:.3f}, {rms_z:.3f} m, "
        "predicted {predicted_x:.3f}, {predicted_y:.3f}, {predicted_z:.3f} m, published",
    ),
    (
        "docs/status.md",
        "at the 40 points {rms_x:.3f}, {rms_y:.3f}, {rms_z:.3f} m ({predicted_x:.3f}, {predicted_y:.3f}, "
        "{predicted_z:.3f}); y-parallaxes RMS {parallax_rms:.1f} ({parallax_rms_predicted:.1f}), largest "
        "{parallax_largest:.1f} ({parallax_largest_predicted:.1f}) µm",
    ),
    (
        "docs/status.md",
        "χ² of the nine {chi_squared:.1f} (< {chi_squared_limit:.1f}; 10.0 before σ were scaled by group), "
        "largest t {largest_t:.1f}; σ c {focal_length_um:.2f}, x0, y0 {principal_point_um:.2f} µm",
    ),
)


def shown(readme: str) -> str:
    """What README shows of the demonstration's end."""
    match = _SHOWN.search(readme)
    if match is None:
        raise ValueError("README.md has no block after “ends with:”.")
    return match[2]


def figures_of(printed: str) -> dict[str, float]:
    """Figures of the demonstration, from what it prints: σ in the units of the sentences, and differences."""
    number = r"([+−-]?[\d,]*\.?\d+)"

    def row(title: str, count: int, text: str = printed) -> list[float]:
        found = re.search(rf"^{title}{rf' +{number}' * count}", text, re.MULTILINE)
        if found is None:
            raise ValueError(f"The demonstration prints no line “{title}” with {count} numbers.")
        return [float(value.replace(",", "").replace("−", "-")) for value in found.groups()]

    sigma = {
        name: row(rf"{name} +\S+", 3)[2]
        for name in (
            "focal_length", "principal_point_x", "principal_point_y", "boresight_roll", "boresight_pitch",
            "boresight_yaw", "gnss_shift_x", "gnss_shift_y", "gnss_shift_z",
        )
    }  # fmt: skip
    chi = re.search(rf"χ² = {number}; 99 % of flights stay below {number}\.", printed)
    error = re.search(rf"largest error of a parameter is {number} σ", printed)
    if chi is None or error is None:
        raise ValueError("The demonstration does not print its tests.")
    rms, predicted = row("RMS", 3), row("predicted RMS", 3)
    parallaxes = printed.split("y-parallaxes", 1)[1]
    rms_um, largest_um = row("RMS", 2, parallaxes), row("largest", 2, parallaxes)
    return {
        "focal_length_um": 1e3 * sigma["focal_length"],
        "principal_point_um": max(sigma["principal_point_x"], sigma["principal_point_y"]),
        "roll_pitch_mdeg": max(sigma["boresight_roll"], sigma["boresight_pitch"]),
        "yaw_mdeg": sigma["boresight_yaw"],
        "shift_plan_cm": max(sigma["gnss_shift_x"], sigma["gnss_shift_y"]),
        "shift_up_cm": sigma["gnss_shift_z"],
        "chi_squared": float(chi[1]),
        "chi_squared_limit": float(chi[2]),
        "largest_t": float(error[1]),
        **dict(zip(("rms_x", "rms_y", "rms_z"), rms, strict=True)),
        **dict(zip(("predicted_x", "predicted_y", "predicted_z"), predicted, strict=True)),
        "parallax_rms": rms_um[0],
        "parallax_rms_predicted": rms_um[1],
        "parallax_largest": largest_um[0],
        "parallax_largest_predicted": largest_um[1],
    }


def excerpt(printed: str) -> str:
    """The part of the output that README shows, without the errors of every kind and the rows on limits."""
    text = "\n".join(line.rstrip() for line in printed.splitlines())
    text = re.sub(r".*?^(?=[\d,]+ images, )", "", text, count=1, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"^unknowns.*?(?=^The flight is )", "", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"^Control points \(not independent\).*?\n\n", "", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"^(?:  from \(|  to \(|mean  |RMS in GSD).*\n", "", text, flags=re.MULTILINE)
    text = re.sub(
        r"(^largest  [^\n]*\n).*?(?=^The result )", r"\1\n…\n\n", text, flags=re.DOTALL | re.MULTILINE
    )
    text = re.sub(r"(Certificate: [^\n]*\n).*", r"\1", text, flags=re.DOTALL)
    return text.strip() + "\n"


def main() -> int:
    """Carry out the demonstration; write what it prints, and its figures, into the pages."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(sys.executable).with_name("aerocal")
        command = [program, "flight-check", "uce-calibration", "--calibrate", "--out", "results/demo"]
        done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    printed = excerpt(done.stdout)
    readme = README.read_text(encoding="utf-8")
    README.write_text(_SHOWN.sub(lambda match: match[1] + printed + match[3], readme), encoding="utf-8")
    figures = figures_of(printed)
    write_figures(SENTENCES, figures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
