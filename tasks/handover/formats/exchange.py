"""Block exchange: formats of whole blocks, with observations, control, cameras and orientations.

Who reads one can adjust the block again. They are written of adjusted results (``aerocal export``) and of deliveries as
they are (``aerocal convert``).
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Mapping

from adjust.handover.refit import Freed
from tasks.handover.delivery import DeliveryFormat
from tasks.handover.formats.bingo import write_bingo
from tasks.handover.formats.blocks_exchange import write_blocks_exchange
from tasks.handover.formats.colmap import write_colmap
from tasks.handover.formats.corrected_csv import write_corrected_csv
from tasks.handover.formats.openmvg import write_openmvg
from tasks.handover.formats.opensfm import write_opensfm
from tasks.handover.formats.opf import write_opf
from tasks.handover.formats.patb import write_patb

#: Brown's terms, and those with different focal lengths along columns and rows.
LENS = ("k1", "k2", "k3", "p1", "p2")
LENS_OF_TWO_FOCAL_LENGTHS = (*LENS, "b1")

EXCHANGE: Mapping[str, DeliveryFormat] = {
    item.name: item
    for item in (
        DeliveryFormat(
            "blocks-exchange",
            write_blocks_exchange,
            "1e-6 m, 1e-15 of a rotation, 1e-4 px",
            lens=LENS,
            points=True,
            on_wgs84=True,
        ),
        DeliveryFormat(
            "colmap",
            write_colmap,
            "1e-6 m of points, 15 digits of orientations, 1e-4 px",
            seen=True,
            lens=LENS_OF_TWO_FOCAL_LENGTHS,
            points=True,
            surveyed="none",
            rigs="all",
        ),
        DeliveryFormat(
            "opensfm",
            write_opensfm,
            "17 digits; image points 1e-9 of the longer side",
            lens=LENS_OF_TWO_FOCAL_LENGTHS,
            points=True,
            on_wgs84=True,
            rigs="all",
        ),
        DeliveryFormat(
            "opf",
            write_opf,
            "17 digits; tie points float32: 1e-3 px",
            seen=True,
            lens=LENS,
            points=True,
            rigs="with-reference",
        ),
        DeliveryFormat("openmvg", write_openmvg, "17 digits", lens=LENS, points=True),
        DeliveryFormat(
            "patb",
            write_patb,
            "1e-5 m, 1e-12 of a rotation; control 1e-4 m, image points 1e-4 µm",
            points=True,
            corrected=True,
            surveyed="all",
        ),
        DeliveryFormat(
            "bingo",
            write_bingo,
            "1e-4 m, 1e-7 gon; image points 1e-4 µm",
            points=True,
            corrected=True,
        ),
        DeliveryFormat(
            "corrected-csv",
            write_corrected_csv,
            "1e-4 m, 1e-7°; image points 1e-4 µm",
            Freed(focal_length=True),
            points=True,
            corrected=True,
            surveyed="all",
            straight=True,
        ),
    )
}
