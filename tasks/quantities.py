"""The vocabulary of quantities: unit, wording, digits and axes of system parameters, one row for each kind.

Which parameters there are, in SI, is said by `adjust.parameters`; what tables, settings and people call them
is said here. Text is made from a quantity and never read back: whoever needs its kind or axis looks it up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from adjust.parameters import (
    BORESIGHT,
    FAMILIES,
    GNSS_DRIFT,
    GNSS_SHIFT,
    GNSS_STRIP_BIAS,
    INS_DRIFT,
    INS_STRIP_BIAS,
    INTERIOR_ORIENTATION,
    LEVER_ARM,
    TIME_OFFSET,
    EntityKind,
    Family,
)
from adjust.rig import RELATIVE_POSITION, RELATIVE_ROTATION, SYNCHRONISATION_OFFSET


class Shown(NamedTuple):
    """A customary unit, its factor from the unit of the tables, and decimals."""

    unit: str
    factor: float = 1.0
    decimals: int = 6


#: What a number is: a size or its σ in a report, a σ in a sentence, a change between calibrations, a size on
#: the screen.
Use: TypeAlias = Literal["plain", "sigma", "change", "screen"]
_SHOWN: Mapping[str, Mapping[Use, Shown]] = {
    "mm": {"plain": Shown("µm", 1e3, 1), "screen": Shown("µm", 1e3, 2)},
    "deg": {"plain": Shown("°", 1.0, 5), "screen": Shown("mdeg", 1e3, 3)},
    "m": {
        "plain": Shown("m", 1.0, 3), "sigma": Shown("cm", 1e2),
        "change": Shown("mm", 1e3), "screen": Shown("cm", 1e2, 2),
    },
    "s": {"plain": Shown("ms", 1e3, 2), "screen": Shown("ms", 1e3, 3)},
    "m/s": {"plain": Shown("m/s"), "sigma": Shown("cm/s", 100.0)},
    "deg/s": {"plain": Shown("°/s"), "screen": Shown("mdeg/s", 1e3, 4)},
    "1": {"plain": Shown("%", 100.0), "sigma": Shown(""), "change": Shown("1"), "screen": Shown("1")},
    "1e-6": {"plain": Shown("ppm")},
}  # fmt: skip
_NAMES = {"1": "", "um": "µm", "deg": "°"}


def shown(unit: str, use: Use = "plain") -> Shown:
    """The customary unit for numbers in a unit of the tables; otherwise that unit itself."""
    known = _SHOWN.get(unit, {})
    return known.get(use) or known.get("plain") or Shown(unit)


def unit_words(unit: str) -> str:
    """A unit of tables and gates as written after an unchanged number."""
    return _NAMES.get(unit, unit)


def with_unit(number: object, unit: str) -> str:
    """A number with its unit; degrees without a space."""
    return f"{number}{'' if unit in ('', '°') else ' '}{unit}"


def written_sigma(value: float, unit: str) -> str:
    """A standard deviation in its customary unit: µm, °, cm, ms."""
    name, factor, _ = shown(unit, "sigma")
    if name == "°":
        return f"{np.format_float_positional(value, precision=2, fractional=False, trim='-')}°"
    return with_unit(f"{value * factor:.3g}", name)


@dataclass(frozen=True)
class Kind:
    """Parameters that are freed, limited and spoken of together; all but the first four have a default.

    Attributes
    ----------
    name : in `adjustment.free`; those of its components are this name with an axis behind it.
    family : of `adjust.parameters`.
    places : which components of its family these are; empty: all.
    unit : in tables.
    words : what is estimated, in a list.
    caption : of a table of them in a certificate; empty: the words.
    axes : direction of each component in words; empty for a single one.
    symbols : of the components; of what has none, and of axes with a name of their own, empty.
    short : words before the axis in rows of matrices; None: the name of the component, empty: the symbol.
    long : what a single one is called where there is room.
    is_large : whether a value, unlike its change, is read in the unit of the tables.
    sigma_limits : fields of the limits of a calibration flight, for all components or one for each.
    observed_by : what alone observes it, see `adjustment.observe`; empty: several.
    needs_headings : whether GNSS tells it from others in several flight directions only.
    more : what determines it better, where no direction or height is missing.
    """

    name: str
    family: str
    unit: str
    words: str
    caption: str = ""
    axes: tuple[str, ...] = ()
    symbols: tuple[str, ...] = ("",)
    short: str | None = None
    long: str = ""
    is_large: bool = False
    sigma_limits: tuple[str, ...] = ()
    observed_by: Literal["", "gnss", "ins"] = ""
    needs_headings: bool = False
    more: str = ""
    places: tuple[int, ...] = ()

    @property
    def components(self) -> tuple[int, ...]:
        """Which components of its family it has."""
        return self.places or tuple(range(len(FAMILIES[self.family].components)))

    @property
    def entity_kind(self) -> EntityKind:
        """The kind of entity that has its own set of them."""
        return FAMILIES[self.family].entity_kind

    def key(self, unit: str) -> str:
        """Its setting in a unit: ``boresight_deg``, ``gnss_drift_m_s``."""
        return f"{self.name}_{unit.replace('µ', 'u').replace('°', 'deg').replace('/', '_')}"


_XYZ = ("east", "north", "up")
#: By name, in the order of the settings.
KINDS: Mapping[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind(
            "boresight", BORESIGHT, "deg", "boresight misalignment",
            caption="Boresight misalignment, body axes of the inertial unit",
            axes=("roll", "pitch", "yaw"), symbols=("about forward", "about right", "about down"),
            sigma_limits=("roll_pitch_deg", "roll_pitch_deg", "yaw_deg"), observed_by="ins",
            more="more exposures, or more accurate attitudes",
        ),
        Kind(
            "lever_arm", LEVER_ARM, "m", "lever arm",
            caption=
                "Lever arm from the projection centre to the point to which the positions refer, "
                "body axes",
            axes=("forward", "right", "down"), symbols=("l x", "l y", "l z"), short="lever arm",
            sigma_limits=("lever_arm_m",), observed_by="gnss", needs_headings=True,
        ),
        Kind(
            "gnss_shift", GNSS_SHIFT, "m", "GNSS shift of each flight", caption="GNSS shift",
            axes=_XYZ, symbols=("s x", "s y", "s z"), short="shift",
            sigma_limits=("shift_m",), observed_by="gnss", needs_headings=True,
            more="more strips, or more control points",
        ),
        Kind(
            "gnss_strip_bias", GNSS_STRIP_BIAS, "m", "GNSS bias of each strip",
            axes=_XYZ, observed_by="gnss",
        ),
        Kind("gnss_drift", GNSS_DRIFT, "m/s", "GNSS drift of each strip", axes=_XYZ, observed_by="gnss"),
        Kind(
            "ins_strip_bias", INS_STRIP_BIAS, "deg", "INS bias of each strip",
            axes=("roll", "pitch", "yaw"), observed_by="ins",
        ),
        Kind(
            "ins_drift", INS_DRIFT, "deg/s", "INS drift of each strip",
            axes=("roll", "pitch", "yaw"), observed_by="ins",
        ),
        Kind(
            "time_offset", TIME_OFFSET, "s", "time offset of each flight", caption="Time offset",
            symbols=("Δt",), short="", observed_by="gnss",
        ),
        Kind(
            "focal_length", INTERIOR_ORIENTATION, "mm", "focal length", symbols=("c",), short="",
            long="focal length (principal distance)", is_large=True, sigma_limits=("focal_length_um",),
            places=(0,),
        ),
        Kind(
            "principal_point", INTERIOR_ORIENTATION, "mm", "principal point",
            axes=("along columns", "against rows"), symbols=("x0", "y0"), short="",
            sigma_limits=("principal_point_um",), needs_headings=True, places=(1, 2),
        ),
        Kind(
            "relative_position", RELATIVE_POSITION, "m", "relative position of each head of a rig",
            caption=
                "Position of the heads relative to the projection centre of the reference head, body "
                "axes",
            axes=("forward", "right", "down"), symbols=("t x", "t y", "t z"), short="relative position",
            more="flights at different heights",
        ),
        Kind(
            "relative_rotation", RELATIVE_ROTATION, "deg", "relative rotation of each head of a rig",
            caption="Rotation of the heads against the reference head, body axes",
            axes=("roll", "pitch", "yaw"), symbols=("about forward", "about right", "about down"),
            is_large=True, more="more object points that several heads see",
        ),
        Kind(
            "synchronisation_offset", SYNCHRONISATION_OFFSET, "s",
            "synchronisation offset of each head of a rig",
            caption="Synchronisation offset of the heads after the reference head", symbols=("τ",), short="",
            more="a flight in which the body turns more, with its rates delivered",
        ),
    )
}  # fmt: skip


class Component(NamedTuple):
    """One component of a kind: its name in tables, its axis in this name and in words, and its symbol."""

    kind: Kind
    name: str
    axis: str
    direction: str
    symbol: str
    sigma_limit: str


def _each(values: tuple[str, ...], place: int) -> str:
    return "" if not values else values[place if len(values) > 1 else 0]


#: By name, in the order of the families.
COMPONENTS: Mapping[str, Component] = {
    name: Component(
        kind,
        name,
        name[len(kind.name) + 1 :],
        _each(kind.axes, place),
        _each(kind.symbols, place),
        _each(kind.sigma_limits, place),
    )
    for family in FAMILIES.values()
    for kind in sorted(
        (kind for kind in KINDS.values() if kind.family == family.name), key=lambda k: k.components
    )
    for place, name in enumerate(family.components[index] for index in kind.components)
}


def kind_of(parameter: str) -> str:
    """The kind of a parameter; of an additional one its set."""
    known = COMPONENTS.get(parameter)
    return known.kind.name if known is not None else additional_set(parameter)


def entity_kind(parameter: str) -> EntityKind:
    """What has a parameter; additional ones belong to cameras."""
    known = COMPONENTS.get(parameter)
    return "camera" if known is None else known.kind.entity_kind


def is_additional(parameter: str) -> bool:
    """Whether a parameter is an additional one, ``SET:NAME``."""
    return parameter not in COMPONENTS


def additional_set(parameter: str) -> str:
    """The set of an additional parameter; empty for any other."""
    return parameter.rpartition(":")[0] if is_additional(parameter) else ""


def is_calibrated(parameter: str) -> bool:
    """Whether a parameter is a quantity of a calibration; those random in every strip are not."""
    return entity_kind(parameter) != "strip"


_PER_RADIAN = float(np.rad2deg(1.0))
_FROM_SI = {("m", "mm"): 1e3, ("rad", "deg"): _PER_RADIAN, ("rad/s", "deg/s"): _PER_RADIAN}


def reported_unit(family: Family, component: int = 0) -> tuple[str, float]:
    """Unit of a parameter in the tables and the factor from SI; additional ones keep their own."""
    return reported(family.components[component], family.unit_of(component))


def reported(parameter: str, si: str) -> tuple[str, float]:
    """The same of a parameter of which name and SI unit are known."""
    known = COMPONENTS.get(parameter)
    unit = si if known is None else known.kind.unit
    return unit, _FROM_SI.get((si, unit), 1.0)


def quantity_words(name: object) -> str:
    """A kind, parameter or other quantity in words: ``GNSS shift x``; ``bluh:7`` as it is."""
    text = str(name)
    return text if ":" in text else text.replace("_", " ").replace("gnss", "GNSS").replace("ins ", "INS ")


def entity_words(name: str, entity: str) -> str:
    """A quantity with its entity: ``GNSS shift x of flight 1``, ``principal point x of UCE-80``."""
    if not entity:
        return quantity_words(name)
    kind = "" if is_additional(name) else entity_kind(name)
    return f"{quantity_words(name)} of {f'{kind} ' if kind in ('flight', 'strip') else ''}{entity}"


def named(name: str, entity: str) -> str:
    """A quantity in sentences that refer to settings: ``gnss_shift_x of 1``."""
    return f"{name} of {entity}"


def observation_group(name: str) -> str:
    """The observation group of a name in residuals.parquet.

    There, priors have their entity after it, and distances the point at their other end.
    """
    return ":".join(name.split(":")[: 2 if name.startswith("prior:") else 1])


def group_words(name: str) -> str:
    """The name of an observation group in words, and after a comma the entity that it may have."""
    group = observation_group(name)
    entity = name[len(group) + 1 :]
    plain = group.replace("_", " ").replace("prior:", "priors: ")
    words = plain.replace("gnss", "GNSS").replace("ins ", "INS ")
    return f"{words}, {entity}" if entity else words
