"""Settings of the accuracy statements that an authority requires of this project."""

from __future__ import annotations

from pathlib import Path

from pydantic import field_validator, model_validator

from tasks.accuracy.statement import AccuracyClass
from tasks.accuracy.template import Standard, Template, delivered, read_template
from tasks.errors import InputError
from tasks.settings.base import InputPath, Settings, trouble
from tasks.settings.coordinates import PositivePair


class StatementSettings(Settings):
    """A statement about the accuracy at the check points, by a published standard or a template."""

    standard: Standard | None = None
    """A delivered standard; either this or `template`."""
    template: InputPath | None = None
    """TOML file of your own [template](statements.md#templates); relative to the project file."""
    class_m: PositivePair | None = None
    """Accuracy class to be met, horizontal and vertical RMSE including the survey, m; one number or two.
    Default: no class.
    """
    vegetated: tuple[str, ...] = ()
    """Names of check points under vegetation: they are stated separately (VVA), without a class."""

    @field_validator("template", mode="after")
    @classmethod
    def _usable(cls, value: Path | None) -> Path | None:
        if value is not None:
            try:
                read_template(value)
            except InputError as error:
                raise trouble(error.what, error.remedy) from error
        return value

    @model_validator(mode="after")
    def _one_of_both(self) -> StatementSettings:
        if (self.standard is None) == (self.template is None):
            raise trouble("A statement has either a standard or a template.", "Give one of the two.")
        return self

    @model_validator(mode="after")
    def _used(self) -> StatementSettings:
        """Whether the template says something about everything that is given."""
        if self.class_m is None and not self.vegetated:
            return self
        template = self.content()
        if self.class_m is not None and not any(part.class_of for part in template.parts):
            raise trouble(
                f"class_m is given, but the statement by {template.name} has no accuracy class.",
                "Remove class_m, or name a standard or template that has a class.",
            )
        if self.vegetated and not any(part.points == "vegetated" for part in template.parts):
            raise trouble(
                f"vegetated is given, but the statement by {template.name} says nothing about points under "
                "vegetation.",
                "Remove it, and every check point counts, or name a template with a part about them.",
            )
        return self

    @property
    def wanted(self) -> AccuracyClass | None:
        """The class to be met; None: none."""
        return None if self.class_m is None else AccuracyClass(*self.class_m)

    def content(self) -> Template:
        """The template from which it is made."""
        if self.standard is not None:
            return delivered(self.standard)
        if self.template is None:
            raise ValueError("a statement without a template")
        return read_template(self.template)
