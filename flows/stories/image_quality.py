"""Image quality: from images to edges, noise and defects, their page, and a certificate."""

from __future__ import annotations

from flows.runs.stage import stage
from tasks.image_quality import publication
from tasks.results.summary import Summary
from tasks.settings.image_quality import ImageQualitySettings
from tasks.stages import image_quality as examination
from tasks.stages import image_quality_page, radiometric_certificate
from tasks.store.store import Outputs, Store

compare_dates = stage(examination.compare_dates)
examine_images = stage(examination.examine_images)
examine_sensor = stage(examination.examine_sensor)
write_certificate = stage(radiometric_certificate.write_radiometric_certificate)
write_page = stage(image_quality_page.write_image_quality_page)
publish = stage(publication.publish_image_quality)


def stages_of(settings: ImageQualitySettings) -> tuple[str, ...]:
    """Names of the stages that the settings need, in their order."""
    wanted = {
        "image_quality": bool(settings.images),
        "edge_drift": bool(settings.images) and settings.earlier is not None,
        "sensor_quality": settings.sensor is not None,
        "image_quality_page": True,
        "radiometric_certificate": settings.sensor is not None,
    }
    return tuple(name for name, is_wanted in wanted.items() if is_wanted)


def image_quality(settings: ImageQualitySettings, store: Store) -> Summary:
    """Examine scenes and sensor, draw the page, certify what has been examined of a sensor, publish."""
    examined: tuple[Outputs, ...] = ()
    if settings.images:
        examined = (examine_images(store, settings=settings.of_scenes()),)
    if settings.images and settings.earlier is not None:
        drift = compare_dates(store, means=examined[0]["edge_means"], earlier=settings.earlier_alone())
        examined = (*examined, drift)
    if settings.sensor is not None:
        examined = (*examined, examine_sensor(store, settings=settings.sensor))
    page = write_page(store, stages=examined, settings=settings, name=settings.name)
    pages: tuple[Outputs, ...] = (page,)
    if settings.sensor is not None:
        pages = (*pages, write_certificate(store, stages=examined, settings=settings, name=settings.name))
    return publish(store, settings, (*examined, *pages))
