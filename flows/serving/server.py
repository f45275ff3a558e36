"""The program of the server: Prefect's own, made to work with the SQLAlchemy that is installed.

Since SQLAlchemy 2.1 a bulk INSERT refuses values of hybrid properties that do not say what becomes of them;
2.0 left them alone. Prefect 3.8 hands such a value (the state of a flow run, stored by other means) to the
INSERT of every scheduled run, so no schedule would ever begin anything. Here those properties are told to
leave the values alone again, in the server's process only.
"""

from __future__ import annotations

import runpy
from collections.abc import MutableMapping
from typing import Any, cast


def main() -> None:
    """Carry out a command of Prefect's command line, with the arguments of this process."""
    leave_hybrid_values_alone()
    runpy.run_module("prefect", run_name="__main__", alter_sys=True)


def leave_hybrid_values_alone() -> None:
    """Let bulk INSERTs of Prefect's tables pass over hybrid properties, as SQLAlchemy 2.0 did."""
    from prefect.server.database import orm_models
    from sqlalchemy.ext.hybrid import hybrid_property

    for table in (orm_models.FlowRun, orm_models.TaskRun, orm_models.FlowRunState, orm_models.TaskRunState):
        for kind in table.__mro__:
            for member in vars(kind).values():
                if isinstance(member, hybrid_property) and getattr(member, "bulk_dml_setter", None) is None:
                    member.bulk_dml_setter = cast(Any, _leave_alone)


def _leave_alone(_table: type, _values: MutableMapping[str, object], _value: object) -> None:
    """What becomes of the value of a property in a bulk INSERT: nothing."""


if __name__ == "__main__":
    main()
