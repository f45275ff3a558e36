"""Tables of what was delivered, and of the approximate values and orientations of film made of it."""

from __future__ import annotations

from tasks.tables.schemas.columns import (
    CAMERA,
    FLIGHT,
    IMAGE,
    OPK,
    OPTIONAL_ANGLES,
    OTHER_POINT,
    POINT,
    STRIP,
    XYZ,
    XYZ_M,
    TableSchema,
    count,
    flag,
    number,
    position,
    sigmas,
    text,
)

CAMERAS = TableSchema(
    "cameras",
    "A camera as certified and mounted.",
    (
        CAMERA,
        count("columns", "width of the image in pixels"),
        count("rows", "height of the image in pixels"),
        number("pixel_um", "side of a pixel"),
        number("focal_length_mm", "principal distance"),
        number("principal_point_x_mm", "principal point from the format centre, along columns"),
        number("principal_point_y_mm", "principal point from the format centre, against rows"),
        text(
            "pixel_origin",
            "point of the top-left pixel with pixel coordinates (0, 0)",
            values=("corner", "centre"),
        ),
        count("mount_deg", "κ_mount of the nominal mounting diag(1, −1, −1) R_z(κ_mount), body from camera"),
        count(
            "calibration_axes_deg",
            "rotation from the image axes to those of additional parameters, counter-clockwise",
        ),
        text("tiles", "layout of the CCD images as JSON, mm; null: that of the parameter set", nullable=True),
        text(
            "additional_parameters", "known additional parameters as JSON, SET:NAME to value in its own unit"
        ),
        *(
            number(f"lever_arm_{axis}_m", f"given lever arm in body axes, {way}")
            for axis, way in (("x", "forward"), ("y", "right"), ("z", "down"))
        ),
        *(
            number(f"reduced_by_{axis}_m", f"lever arm of reduced positions, {way}")
            for axis, way in (("x", "forward"), ("y", "right"), ("z", "down"))
        ),
        *(
            number(f"boresight_{name}_deg", f"given boresight misalignment, {name}")
            for name in ("roll", "pitch", "yaw")
        ),
        text(
            "head_of",
            "reference head of the rig; null: the camera is not a head of a rig, or is the reference head",
            nullable=True,
        ),
        *(
            number(f"relative_position_{axis}_m", f"given position against it, {way}", nullable=True)
            for axis, way in (("x", "forward"), ("y", "right"), ("z", "down"))
        ),
        *(
            number(f"relative_rotation_{name}_deg", f"given rotation against it, {name}", nullable=True)
            for name in ("roll", "pitch", "yaw")
        ),
        number("synchronisation_offset_s", "given delay after the moment of the event", nullable=True),
        *(
            text(name, f"what it is a calibration of: {words}; null: not declared", nullable=True)
            for name, words in (
                ("body", "serial number of the body"),
                ("lens", "serial number of the lens"),
                ("imu", "serial number of the inertial unit"),
                ("mount", "installation in the aircraft"),
                ("band", "spectral band of a head"),
                ("software", "version of the manufacturer's software"),
            )
        ),
        text("product", "type of image", values=("virtual_image", "camera_head")),
        text(
            "calibration_use",
            "how the covariance of its calibration is used; null: the values are treated as exact",
            nullable=True,
            values=("consider", "prior"),
        ),
        text(
            "calibration_covariance",
            "names of the calibrated parameters and their covariance as JSON, units as in parameters",
            nullable=True,
        ),
    ),
    ("camera",),
)

IMAGES = TableSchema(
    "images",
    "An image of the block.",
    (
        IMAGE,
        CAMERA,
        STRIP,
        FLIGHT,
        number("heading_deg", "heading of the body, clockwise from true north", nullable=True),
        number(
            "height_above_ground_m",
            "flying height above the median of the object points in the image",
            nullable=True,
        ),
        text("status", "whether the image is used in the adjustment, or why not"),
    ),
    ("image",),
)

IMAGE_POINTS = TableSchema(
    "image_points",
    "A measured image point.",
    (
        IMAGE,
        POINT,
        number("x_mm", "x in the image system: from the format centre along columns"),
        number("y_mm", "y in the image system: from the format centre against rows"),
        number("sigma_x_mm", "standard deviation of x_mm"),
        number("sigma_y_mm", "standard deviation of y_mm"),
        text("input_file", "name of the input file", nullable=True),
    ),
    ("image", "point"),
)

EXPOSURES = TableSchema(
    "exposures",
    "GNSS/INS or given orientation of an image, in the CRS of the project; null is not given.",
    (
        IMAGE,
        CAMERA,
        STRIP,
        FLIGHT,
        number("time_s", "time on the scale of the delivery", nullable=True),
        text("event", "delivered name of the event of a rig, in its flight", nullable=True),
        *position("position", nullable=True),
        *sigmas(XYZ, "m", nullable=True),
        *OPTIONAL_ANGLES,
        *sigmas(("omega", "phi", "kappa", "heading", "pitch", "roll"), "deg", nullable=True),
        *(
            number(f"rate_{name}_deg_s", f"angular velocity of the body about its axis {way}", nullable=True)
            for name, way in (("roll", "forward"), ("pitch", "right"), ("yaw", "down"))
        ),
        *(
            number(f"velocity_{way}_m_s", f"velocity of the position, {words}", nullable=True)
            for way, words in (("east", "true east"), ("north", "true north"), ("up", "up"))
        ),
        text(
            "position", "point to which the position refers", values=("projection_centre", "antenna", "imu")
        ),
    ),
    ("image",),
    XYZ_M,
)

TRAJECTORIES = TableSchema(
    "trajectories",
    "A sample of a trajectory from which exposures were taken, in the CRS of the project; thinned.",
    (
        text("trajectory", "name of the file"),
        number("time_s", "time on the scale of the delivery"),
        *position("sample"),
        text("solution", "kind of the GNSS solution, null if not stated", nullable=True),
        flag("after_gap", "whether a gap lies before it, in which nothing is interpolated"),
        flag("is_outlier", "whether it is near an exposure and inconsistent with its neighbouring samples"),
    ),
    ("trajectory", "time_s"),
    XYZ_M,
)

CONTROL_POINTS = TableSchema(
    "control_points",
    "A surveyed point in the CRS of the project; a null coordinate is not known.",
    (
        POINT,
        *position("point", nullable=True),
        *sigmas(XYZ, "m", nullable=True),
        text(
            "role",
            "the coordinates of a check point are never used in an adjustment",
            values=("control", "check"),
        ),
    ),
    ("point",),
    XYZ_M,
)

DISTANCES = TableSchema(
    "distances",
    "A measured slope distance between two object points.",
    (
        POINT,
        OTHER_POINT,
        number("distance_m", "the distance"),
        number("sigma_m", "its standard deviation"),
        text("role", "a check distance is never used in an adjustment", values=("control", "check")),
    ),
    ("point", "other_point"),
)

APPROXIMATE_BORESIGHT = TableSchema(
    "approximate_boresight",
    "Initial boresight of a camera in the adjustment: as given, or derived from the tie points.",
    (
        CAMERA,
        number("roll_deg", "boresight roll"),
        number("pitch_deg", "boresight pitch"),
        number("yaw_deg", "boresight yaw"),
    ),
    ("camera",),
)

APPROXIMATE_ORIENTATIONS = TableSchema(
    "approximate_orientations",
    "Orientation computed from image points for an image without or with incomplete orientation; not "
    "an observation.",
    (
        IMAGE,
        CAMERA,
        *position("projection centre"),
        *OPK,
    ),
    ("image",),
    XYZ_M,
)

APPROXIMATE_POINTS = TableSchema(
    "approximate_points",
    "An object point intersected from the given orientations.",
    (
        POINT,
        *position("point", nullable=True),
        count("rays", "number of image points"),
        number("angle_deg", "largest angle between two rays", nullable=True),
        text("status", "whether the point is used in the adjustment, or why not"),
    ),
    ("point",),
    XYZ_M,
)


_TERMS = (("0_mm", "mm", "shift"), ("1", "", "factor of the scanned x"), ("2", "", "factor of the scanned y"))

FILM_ORIENTATIONS = TableSchema(
    "film_orientations",
    "Affine transformation of a film image from its scan to the coordinates of the camera, from the fiducial "
    "marks: x = a0 + a1 x_scan + a2 y_scan, y = b0 + b1 x_scan + b2 y_scan.",
    (
        IMAGE,
        CAMERA,
        count("marks", "number of measured fiducial marks"),
        *(
            number(f"{row}{place}", f"{words}, of {axis}", unit)
            for row, axis in (("a", "x"), ("b", "y"))
            for place, unit, words in _TERMS
        ),
        *(
            number(
                f"sigma_{place}", f"standard deviation of the {words}, from the stated σ of the marks", unit
            )
            for place, unit, words in _TERMS
        ),
        number("sigma0_um", "standard deviation of a measured mark from the residuals", nullable=True),
        number("largest_um", "largest residual"),
        text("largest_mark", "mark with the largest residual"),
        number("largest_standardized", "largest residual over its standard deviation", nullable=True),
    ),
    ("image",),
)
