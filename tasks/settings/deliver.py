"""Settings of deliveries: in which formats a run hands its results over at its end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Annotated, Literal, TypeAlias, get_args

from pydantic import AfterValidator, Field, model_validator

from tasks.settings.base import Settings, one_of, trouble
from tasks.settings.coordinates import LOCAL

#: How a program understands the world; `tasks.handover.receiver` says what each kind is given.
World: TypeAlias = Literal["local", "map", "map-cartesian", "map-cartesian-curved", "rpc"]
WORLDS: tuple[World, ...] = get_args(World)
AngleOrder: TypeAlias = Literal["omega-phi-kappa", "phi-omega-kappa"]
AngleUnit: TypeAlias = Literal["deg", "gon", "rad"]

_LOCAL: tuple[World, ...] = ("local",)
_MAP: tuple[World, ...] = ("map",)
_CARTESIAN: tuple[World, ...] = ("map-cartesian", "local", "map-cartesian-curved")
_CURVED: tuple[World, ...] = ("map-cartesian-curved", "local", "map-cartesian")
_ANY: tuple[World, ...] = ("map-cartesian", "local", "map", "map-cartesian-curved")
_ANY_MAP: tuple[World, ...] = ("map", "local", "map-cartesian", "map-cartesian-curved")


@dataclass(frozen=True)
class Offer:
    """What a format is, and what it can be written for.

    Attributes
    ----------
    meaning : one line for people.
    worlds : kinds of programs; the usual one first.
    dated : whether it cannot be without the date of the flight.
    placed : whether it cannot be without a place on the earth.
    """

    meaning: str
    worlds: tuple[World, ...]
    dated: bool = False
    placed: bool = False


#: Every format of `tasks.handover.formats.exchange`: whole blocks.
EXCHANGE_OFFERS: Mapping[str, Offer] = {
    "blocks-exchange": Offer(
        "BlocksExchange XML: iTwin Capture, ContextCapture, Metashape, RealityScan", _LOCAL
    ),
    "colmap": Offer("COLMAP text model: cameras, images, points", _LOCAL),
    "opensfm": Offer("OpenSfM and ODM: reconstruction.json and tracks.csv", _LOCAL),
    "opf": Offer(
        "OPF project (Pix4D): cameras, control and check points with their marks, tie points",
        _LOCAL,
        dated=True,
    ),
    "openmvg": Offer("OpenMVG sfm_data.json: views, cameras, poses, points", _LOCAL),
    "patb": Offer("PATB .ori, .im, .con: orientations, image points, control", _ANY),
    "bingo": Offer("BINGO image.dat, geoin.dat, itera.dat", _ANY),
    "corrected-csv": Offer(
        "tables: corrected image points, orientations, cameras without distortion, points", _ANY_MAP
    ),
}
#: Every format of `tasks.handover.formats.register`.
OFFERS: Mapping[str, Offer] = {
    **EXCHANGE_OFFERS,
    "inpho": Offer("Inpho project (.prj): cameras, photos, orientations", _CURVED),
    "isat": Offer("ImageStation files photo and camera, distortion grids", _CURVED),
    "eo-csv": Offer(
        "table with header: image, camera, X, Y, Z, angles of any system, standard deviations", _ANY_MAP
    ),
    "esri": Offer("Frames and Cameras tables of ArcGIS", _ANY),
    "orbit": Offer("Orbit 3DM: one line an image, for undistorted images", _ANY),
    "sure": Offer("SURE: one .ori an image, for undistorted images", _LOCAL),
    "metashape": Offer("Metashape OPK text and reference table", ("map", "local")),
    "metashape-xml": Offer(
        "Metashape XML: cameras with distortion, orientations on the earth, markers", _LOCAL
    ),
    "rpc": Offer(
        "rational polynomials, one _RPC.TXT an image: GDAL, QGIS, ArcGIS, ERDAS, Catalyst, OTB, SNAP",
        ("rpc",),
        placed=True,
    ),
    "geopackage": Offer(
        "GeoPackage for QGIS and every GIS: cameras, footprints, points, residual vectors", _MAP
    ),
    "nerfstudio": Offer("nerfstudio and 3D Gaussian splatting: transforms.json", _LOCAL),
    "stac": Offer(
        "STAC items with perspective-imagery: orientation and footprint of every image", _MAP, dated=True
    ),
    "realityscan": Offer(
        "RealityScan (RealityCapture): CSV of registered images and XMP files", ("map", "local")
    ),
    "orthority": Offer(
        "Orthority: interior parameters (YAML), exterior parameters (GeoJSON)",
        ("map-cartesian",),
        placed=True,
    ),
    "catalyst": Offer("Catalyst OrthoEngine: exterior orientations as text, distortion grids", _CURVED),
    "distortion-grid": Offer(
        "tables of the correction over the format of each camera, from measured to ideal points and back",
        _LOCAL,
    ),
    "geojson": Offer(
        "GeoJSON in longitude and latitude: cameras, footprints, surveyed points", _MAP, placed=True
    ),
    "kmz": Offer("KMZ for globes: cameras, footprints, surveyed points", _MAP, placed=True),
}
#: Formats whose angle system can be chosen; that of the others is a part of the format.
CHOSEN_ANGLES = ("eo-csv",)


def own_angles(form: str) -> tuple[str, str]:
    """What is wrong with angles chosen for another format, and the remedy."""
    return f"The format {form} has its own order and unit of angles.", "Leave them out, or choose eo-csv."


def _below_results(text: str) -> str:
    path = PurePosixPath(text)
    if path.is_absolute() or ".." in path.parts or not path.parts or "\\" in text or "\0" in text:
        raise trouble(
            f"A delivery cannot be written into the folder {text!r}.",
            'Name one below the folder of the results, e.g. folder = "export/client".',
        )
    return str(path)


class DeliverSettings(Settings):
    """A delivery that is written at the end of a run."""

    format: Annotated[str, AfterValidator(one_of(lambda: OFFERS, "format of results"))] = Field(
        description="One of [the formats of results](export.md): "
        f"{', '.join(f'`{name}`' for name in OFFERS)}."
    )
    folder: Annotated[str, AfterValidator(_below_results)] | None = None
    """Folder of the files below that of the results; default `export/FORMAT`. An earlier delivery in it is
    removed.
    """
    world: World | None = None
    """How the receiving program [treats coordinates](export.md#what-a-program-can-be-given); default: that of
    the format.
    """
    angles: AngleOrder = "omega-phi-kappa"
    """Order of the angles (`eo-csv`)."""
    unit: AngleUnit = "deg"
    """Unit of the angles (`eo-csv`)."""

    @property
    def place(self) -> str:
        """The folder, below that of the results."""
        return f"export/{self.format}" if self.folder is None else self.folder

    @model_validator(mode="after")
    def _offered(self) -> DeliverSettings:
        worlds = OFFERS[self.format].worlds
        if self.world is not None and self.world not in worlds:
            raise trouble(
                f"The format {self.format} cannot be written for the kind '{self.world}'.",
                f"Name one of: {', '.join(worlds)}.",
            )
        if (self.angles, self.unit) != ("omega-phi-kappa", "deg") and self.format not in CHOSEN_ANGLES:
            raise trouble(*own_angles(self.format))
        return self

    def trouble_with(self, crs: str, *, flown: bool) -> tuple[str, str] | None:
        """What of the project contradicts the delivery, and the remedy; None: nothing.

        Parameters
        ----------
        crs : of the results.
        flown : whether the date of the flight is stated.
        """
        if crs == LOCAL and OFFERS[self.format].placed:
            return (
                f"The format {self.format} requires a location on the earth, but the project is local.",
                'Give the project a CRS, or deliver another format, e.g. format = "blocks-exchange".',
            )
        if OFFERS[self.format].dated and not flown:
            return (
                f"The format {self.format} needs the date of the flight, which the project does not state.",
                "Declare it in the project file, e.g. flown = 2026-05-24 in [project].",
            )
        return None
