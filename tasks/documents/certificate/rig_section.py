"""Section of the rig: all its heads with their joint results, and the virtual image composed of them."""

from __future__ import annotations

from tasks.documents.certificate.content import Block, Figure, Listing, Section, Words
from tasks.documents.certificate.effect_section import cut_to_format
from tasks.documents.certificate.material import CertificateMaterial
from tasks.documents.report.rig_heads import HEADS_NOTE, has_heads, head_tables, platform_table
from tasks.documents.report.virtual_image import virtual_image_plot, virtual_image_table, virtual_images


def rig_section(material: CertificateMaterial) -> Section | None:
    """Heads against their reference head, and the platform calibration; None for a camera alone."""
    results = material.results
    if not has_heads(results):
        return None
    blocks: list[Block] = [
        Listing(table, ("correlated_with",)) for table in head_tables(results) if table.rows
    ]
    blocks.append(
        Words(
            HEADS_NOTE,
            "note",
        )
    )
    if not results.platform.empty:
        images = virtual_images(results)
        blocks.append(Listing(platform_table(results)))
        for number, image in enumerate(images, start=1):
            caption = (
                f"Virtual image of {image.name}: errors of an image composed with the given attitudes "
                "instead of the calibrated ones, for the mean height above ground."
            )
            figure = Figure(
                f"virtual-image-{number}",
                caption,
                f"Errors in the virtual image of {image.name}, up to {image.longest_um:.1f} µm",
                virtual_image_plot(image),
            )
            blocks.append(cut_to_format(figure, image.half_format))
        blocks.append(Listing(virtual_image_table(images)))
    return Section("rig", "Heads of the rig", tuple(blocks))
