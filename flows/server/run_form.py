"""The form of a run: the settings people change between runs, which override those of the project file."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import BaseModel, Field

#: The choice that leaves a setting alone.
AS_GIVEN: Literal["as in the project file"] = "as in the project file"

Number = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class RunForm(BaseModel, frozen=True, extra="forbid", use_attribute_docstrings=True):
    """Settings of one run; unchanged ones come from the project file."""

    rejection: Literal["as in the project file", "none", "3.29", "4.13"] = Field(
        default=AS_GIVEN, title="Rejection of gross errors"
    )
    """Critical value: 4.13 gives one false alarm in 20 blocks of 1,500 observations, 3.29 one in 1,000
    observations; `none`: no rejection.
    """
    rejection_test: Literal["as in the project file", "components", "observations"] = Field(
        default=AS_GIVEN, title="Tested quantity"
    )
    """Single components of an observation, or both coordinates of an image point together."""
    robust: Literal["as in the project file", "huber", "cauchy", "tukey", "biber", "danish"] = Field(
        default=AS_GIVEN, title="Robust search before the tests"
    )
    """Weight function for blocks with very many wrong observations."""
    self_calibration: Literal[
        "as in the project file", "none", "bluh:1-12", "brown:K1,K2", "ebner", "gruen"
    ] = Field(default=AS_GIVEN, title="Additional parameters")
    """Set of additional parameters of the cameras."""
    refraction: Literal["as in the project file", "standard", "none"] = Field(
        default=AS_GIVEN, title="Refraction"
    )
    """`none` for image points that are already corrected for refraction."""
    datum: Literal["as in the project file", "observations", "free_network"] = Field(
        default=AS_GIVEN, title="Datum"
    )
    """`free_network`: the undetermined part is fixed by inner constraints."""
    sigma0: Literal["as in the project file", "a_posteriori", "a_priori"] = Field(
        default=AS_GIVEN, title="σ0 of the standard deviations"
    )
    """`a_priori`: the stated σ of the observations are taken as known."""
    variance_components: Literal["as in the project file", "yes", "no"] = Field(
        default=AS_GIVEN, title="Estimate the σ of the groups"
    )
    """Factors for the σ of image points, control, GNSS, INS and priors from the residuals."""
    max_iterations: Annotated[int, Field(ge=1, le=200)] | None = Field(
        default=None, title="Maximum number of iterations"
    )
    """After this number, the adjustment is regarded as divergent; good initial values need 2 to 5."""
    sigma0_limit: Number | None = Field(default=None, title="Gate: largest σ0")
    """σ0 a posteriori / a priori, e.g. 1.2."""

    def overrides(self) -> tuple[str, ...]:
        """What the form changes in the project file, each as ``a.b.c=VALUE``."""
        return tuple(self._changes())

    def _changes(self) -> Iterator[str]:
        if self.rejection == "none":
            yield 'adjustment.rejection="none"'
        elif self.rejection != AS_GIVEN:
            yield f"adjustment.rejection.critical_value={self.rejection}"
        for key, value in (
            ("rejection.test", self.rejection_test),
            ("rejection.robust", self.robust),
            ("self_calibration.parameters", self.self_calibration),
            ("refraction", self.refraction),
            ("datum", self.datum),
            ("sigma0", self.sigma0),
        ):
            if value != AS_GIVEN and not (self.rejection == "none" and key.startswith("rejection")):
                yield f'adjustment.{key}="{value}"'
        if self.variance_components != AS_GIVEN:
            yield f"adjustment.variance_components={str(self.variance_components == 'yes').lower()}"
        if self.max_iterations is not None:
            yield f"adjustment.max_iterations={self.max_iterations}"
        if self.sigma0_limit is not None:
            yield f"gates.sigma0.max={self.sigma0_limit!r}"
