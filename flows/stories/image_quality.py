"""Image quality: from images to edges, noise and defects, their page, and a certificate."""

from __future__ import annotations

from flows.runs.stage import stage
from flows.stories.block_preparation import import_exposures
from tasks.image_quality import publication
from tasks.results import publish as publishing
from tasks.results.summary import Summary
from tasks.settings.load_image_quality import Examination
from tasks.stages import image_quality as examination
from tasks.stages import image_quality_page, radiometric_certificate
from tasks.store.store import Outputs, Store

compare_dates = stage(examination.compare_dates)
compare_with_motion = stage(examination.compare_with_motion)
examine_images = stage(examination.examine_images)
examine_sensor = stage(examination.examine_sensor)
write_certificate = stage(radiometric_certificate.write_radiometric_certificate)
write_page = stage(image_quality_page.write_image_quality_page)
publish = stage(publication.publish_image_quality)


def stages_of(wanted: Examination) -> tuple[str, ...]:
    """Names of the stages that an examination needs, in their order."""
    settings = wanted.settings
    needed = {
        "import_exposures": settings.motion is not None,
        "image_quality": bool(settings.images),
        "smear_motion": settings.motion is not None,
        "sensor_quality": settings.sensor is not None,
        "drift": settings.earlier is not None,
        "image_quality_page": True,
        "radiometric_certificate": settings.sensor is not None,
    }
    return tuple(name for name, is_needed in needed.items() if is_needed)


def image_quality(wanted: Examination, store: Store) -> Summary:
    """Examine scenes and sensor, draw the page, certify what has been examined of a sensor, publish."""
    publishing.require_replaceable(store, publishing.OF_EVERY_EXAMINATION)
    settings = wanted.settings
    examined = (*_scenes(wanted, store),)
    if settings.sensor is not None:
        examined = (*examined, examine_sensor(store, settings=settings.sensor))
    if settings.earlier is not None:
        drift = compare_dates(store, stages=examined, earlier=settings.earlier_alone())
        examined = (*examined, drift)
    page = write_page(store, stages=examined, settings=settings, name=settings.name)
    pages: tuple[Outputs, ...] = (page,)
    if settings.sensor is not None:
        pages = (*pages, write_certificate(store, stages=examined, settings=settings, name=settings.name))
    return publish(store, settings, (*examined, *pages))


def _scenes(wanted: Examination, store: Store) -> tuple[Outputs, ...]:
    """Results of images of scenes, and whether they agree with the movement of the camera."""
    settings, project = wanted.settings, wanted.project
    if not settings.images:
        return ()
    if settings.motion is None or project is None:
        return (examine_images(store, settings=settings.of_scenes()),)
    read = import_exposures(
        store, sources=project.inputs.exposures, cameras=project.cameras, project=project.project
    )
    scenes = examine_images(store, settings=settings.of_scenes())
    compared = compare_with_motion(
        store,
        edges=scenes["edges"],
        exposures=read["exposures"],
        cameras=read["cameras"],
        settings=settings.motion,
    )
    return scenes, compared
