"""A task function becomes a stage of a story.

While a Prefect flow run is active, calling a stage runs a Prefect task made from the function, so
that the run shows it with state and duration; otherwise it calls the function, and Prefect is never
loaded. Whether a flow run is active is asked of the modules already loaded: this file imports no
Prefect. Prefect's own caching and result persistence stay off, because finished outputs are kept in
the stage store, which knows the content of the inputs and the source of the code.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property, update_wrapper, wraps
from typing import Any, Generic, ParamSpec, TypeVar

from tasks.errors import AerocalError, InputError, NotComputableError

#: Names of the failed states of a task or flow, by the error that leads to them.
STATE_NAMES: Mapping[type[AerocalError], str] = {
    InputError: "InputError",
    NotComputableError: "NotComputable",
}

P = ParamSpec("P")
R = TypeVar("R")


class Stage(Generic[P, R]):
    """A task function that runs as a Prefect task inside a Prefect flow run, and plainly outside.

    Parameters
    ----------
    function : the task function; its name becomes the name of the Prefect task.
    """

    def __init__(self, function: Callable[P, R]) -> None:
        self.function = function
        update_wrapper(self, function)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the stage once."""
        if not flow_run_is_active():
            return self.function(*args, **kwargs)
        state = self._prefect_task(*args, **kwargs, return_state=True)
        result: R = state.result()
        return result

    def map(self, each: Iterable[Mapping[str, object]], *args: object, **common: object) -> tuple[R, ...]:
        """Run the stage once for each set of keyword arguments.

        Parameters
        ----------
        each : the keyword arguments in which the runs differ.
        args, common : the arguments they share.

        Returns
        -------
        results : in the order of `each`, whichever run ends first.
        """
        function: Any = self.function
        if not flow_run_is_active():
            return tuple(function(*args, **common, **one) for one in each)
        futures = [self._prefect_task.submit(*args, **common, **one) for one in each]
        return tuple(future.result() for future in futures)

    @cached_property
    def _prefect_task(self) -> Any:
        """The Prefect task of the same function; made once, and only where Prefect is loaded already."""
        prefect = sys.modules["prefect"]
        policies = sys.modules["prefect.cache_policies"]
        return prefect.task(
            self._with_expected_errors_as_states(),
            name=getattr(self.function, "__name__", "stage"),
            cache_policy=policies.NO_CACHE,
            persist_result=False,
            retries=1,
            retry_condition_fn=_a_retry_can_help,
        )

    def _with_expected_errors_as_states(self) -> Callable[P, Any]:
        """The function, ending in a failed state with one sentence where the user has to do something.

        Prefect logs a traceback for an exception that leaves a task; one that comes as a failed state's
        data reaches the caller all the same, and the state says what it is.
        """

        @wraps(self.function)
        def body(*args: P.args, **kwargs: P.kwargs) -> Any:
            try:
                return self.function(*args, **kwargs)
            except AerocalError as error:
                states = sys.modules["prefect.states"]
                return states.Failed(name=state_name(error), message=str(error), data=error)

        return body


def stage(function: Callable[P, R]) -> Stage[P, R]:
    """Make a task function a stage of a story."""
    return Stage(function)


def _a_retry_can_help(_task: Any, _task_run: Any, state: Any) -> bool:
    """Whether a stage failed for a reason that may pass: a lost connection, never an input or a result."""
    return isinstance(state.data, ConnectionError | TimeoutError)


def state_name(error: AerocalError) -> str:
    """Name of the failed state an expected error ends in."""
    return next((name for kind, name in STATE_NAMES.items() if isinstance(error, kind)), "Failed")


def flow_run_is_active() -> bool:
    """Whether the caller is inside a Prefect flow run; False wherever Prefect is not even loaded."""
    context = sys.modules.get("prefect.context")
    return context is not None and context.FlowRunContext.get() is not None
