"""Calibrated cameras whose values are known with a covariance: considered, or observed together.

The covariance comes with cameras.parquet. Its parameters are those of the camera and its mounting alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from adjust.arrays import Bools, Floats
from adjust.block import Block
from adjust.errors import InconsistentBlockError
from adjust.observations.base import ObservationGroup, StochasticModel
from adjust.observations.direct import DirectObservations
from adjust.observations.joint_prior import JointPrior
from adjust.parameters import (
    ADDITIONAL_PARAMETERS,
    ConsideredParameters,
    ParameterPlace,
    SystemParameters,
)
from tasks.errors import InputError
from tasks.files.json_text import from_json
from tasks.quantities import named, reported_unit


@dataclass(frozen=True, eq=False)
class KnownCalibration:
    """What is known of the calibrated parameters of one camera, or of the heads of one rig together.

    Attributes
    ----------
    camera : its name; of a rig that of the reference head.
    is_prior : whether its parameters are observed; else they are considered.
    names, units : of the k parameters, units of the adjustment.
    places : where they are in the families of the block.
    covariance : (k, k) SI and radians, or the family's own units.
    """

    camera: str
    is_prior: bool
    names: tuple[str, ...]
    units: tuple[str, ...]
    places: tuple[ParameterPlace, ...]
    covariance: Floats


def known_calibrations(block: Block, cameras: pd.DataFrame) -> tuple[KnownCalibration, ...]:
    """Those of the cameras of a block, in its order.

    Parameters
    ----------
    cameras : cameras.parquet.
    """
    rows = {str(row["camera"]): row for row in cameras.to_dict("records")}
    found = []
    for camera in block.cameras:
        text = rows[camera.name]["calibration_covariance"]
        if not isinstance(text, str):
            continue
        known = from_json(text)
        matrix = np.array(known["covariance"], dtype=np.float64)
        # Of a rig the reference head has what is known of all heads.
        owners = known.get("cameras") or [camera.name] * len(matrix)
        chosen = [
            (number, parameters, place)
            for number, (name, owner) in enumerate(zip(known["parameters"], owners, strict=True))
            for parameters in block.system
            for place in _places(parameters, name, owner)
        ]
        own = [number for number, _, _ in chosen]
        scale = np.array([reported_unit(item.family, place.component)[1] for _, item, place in chosen])
        found.append(
            KnownCalibration(
                camera.name,
                rows[camera.name]["calibration_use"] == "prior",
                tuple(
                    _name(item.family.components[place.component], owners[number], camera.name)
                    for number, item, place in chosen
                ),
                tuple(item.family.unit_of(place.component) for _, item, place in chosen),
                tuple(place for _, _, place in chosen),
                matrix[np.ix_(own, own)] / np.outer(scale, scale),
            )
        )
    return tuple(found)


def _name(parameter: str, owner: str, camera: str) -> str:
    """A parameter of the camera itself, or that of another head of its rig."""
    return parameter if owner == camera else named(parameter, owner)


def _places(parameters: SystemParameters, name: str, camera: str) -> list[ParameterPlace]:
    """Where a parameter of a camera stands: once, or for each flight in which it has a set of its own."""
    family = parameters.family
    if family.entity_kind != "camera" or name not in family.components:
        return []
    return [
        ParameterPlace(family.name, entity, family.components.index(name))
        for entity, of in enumerate(parameters.entities)
        if of == camera
    ]


def with_known_calibrations(block: Block, known: tuple[KnownCalibration, ...]) -> Block:
    """The block with the parameters that are observed free, and the others considered.

    Raises
    ------
    InputError
        If a parameter is free that is to be considered, or additional parameters that are to be observed.
    """
    free = {item.family.name: item.free for item in block.system}
    for one in known:
        _refuse_free(one, free)
    system = tuple(replace(item, free=item.free | _observed(item, known)) for item in block.system)
    considered = [one for one in known if not one.is_prior and one.places]
    if not considered:
        return replace(block, system=system)
    places = tuple(place for one in considered for place in one.places)
    covariance, first = np.zeros((len(places), len(places))), 0
    for one in considered:
        own = slice(first, first + len(one.places))
        covariance[own, own], first = one.covariance, own.stop
    return replace(block, system=system, considered=ConsideredParameters(places, covariance))


def _refuse_free(one: KnownCalibration, free: dict[str, Bools]) -> None:
    """Refuse parameters that would be known twice, or not be used as they are."""
    named = [
        name
        for name, place in zip(one.names, one.places, strict=True)
        if free[place.family][place.entity, place.component]
        and (not one.is_prior or place.family == ADDITIONAL_PARAMETERS)
    ]
    if not named:
        if one.is_prior and len(set(one.names)) < len(one.names):
            raise InputError(
                "The additional parameters from the registry are to be observed, but each flight has its "
                "own set.",
                'Set adjustment.self_calibration.per = "camera".',
                entity=f"cameras.{one.camera}",
            )
        return
    several = len(set(named)) > 1
    what = ", ".join(dict.fromkeys(named))
    raise InputError(
        f"{what} {'are' if several else 'is'} free in this project, but the calibration from the registry is "
        + (
            "to be observed."
            if one.is_prior
            else "considered: used unchanged, with its errors included in every σ."
        ),
        f"Hold {'them' if several else 'it'} (adjustment.free, adjustment.self_calibration), or set "
        f"cameras.{one.camera}.calibration_use: "
        + ("" if one.is_prior else '"prior" lets the block improve the calibration, ')
        + '"held" uses its values without their σ.',
        entity=f"cameras.{one.camera}",
    )


def _observed(parameters: SystemParameters, known: tuple[KnownCalibration, ...]) -> Bools:
    """Which parameters (e, d) of a family are observed together with others."""
    observed = np.zeros(parameters.free.shape, dtype=bool)
    for one in known:
        for place in one.places:
            if one.is_prior and place.family == parameters.family.name:
                observed[place.entity, place.component] = True
    return observed


def with_joint_priors(
    block: Block, groups: tuple[ObservationGroup, ...], known: tuple[KnownCalibration, ...]
) -> tuple[ObservationGroup, ...]:
    """Groups with the observations of calibrations, which replace priors of the same parameters."""
    observed = {item.family.name: _observed(item, known) for item in block.system}
    values = {item.family.name: item.values for item in block.system}
    others = []
    for group in groups:
        if isinstance(group, DirectObservations) and observed[group.family.name].any():
            group = group.of_free(~observed[group.family.name])
            if not group.stochastic.present.any():
                continue
        others.append(group)
    priors = (
        JointPrior(
            one.camera,
            one.names,
            one.units,
            one.places,
            np.array([[values[family][entity, part] for family, entity, part in one.places]]),
            _model(one),
        )
        for one in known
        if one.is_prior and one.places
    )
    return (*others, *priors)


def _model(one: KnownCalibration) -> StochasticModel:
    try:
        return StochasticModel.from_covariance(
            one.covariance[None], np.ones((1, len(one.places)), dtype=bool)
        )
    except InconsistentBlockError as error:
        raise InputError(
            "The covariance matrix of the calibration is singular, so it cannot be observed.",
            f'Set cameras.{one.camera}.calibration_use = "consider".',
            entity=f"cameras.{one.camera}",
        ) from error
