"""A task function becomes a stage of a story.

While a Prefect flow run is active, calling a stage runs a Prefect task made from the function, so
that the run shows it with state and duration; otherwise it calls the function, and Prefect is never
loaded. Whether a flow run is active is determined from the modules already loaded: this file does not
import Prefect. Prefect's own caching and result persistence stay off, because finished outputs are kept in
the stage store, which knows the content of the inputs and the source of the code.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, as_completed
from functools import cached_property, partial, update_wrapper, wraps
from typing import Any, Generic, Literal, ParamSpec, TypeAlias, TypeVar

from tasks.errors import AerocalError, InputError, NotComputableError

#: Names of the failed states of a task or flow, by the error that leads to them.
FailedState: TypeAlias = Literal["InputError", "NotComputable", "Failed"]
STATE_NAMES: Mapping[type[AerocalError], FailedState] = {
    InputError: "InputError",
    NotComputableError: "NotComputable",
}

P = ParamSpec("P")
R = TypeVar("R")

#: What became of one call: its result, or the reason why there is none.
Attempt: TypeAlias = R | InputError | NotComputableError
_EXPECTED = (InputError, NotComputableError)


class Stage(Generic[P, R]):
    """A task function that runs as a Prefect task inside a Prefect flow run, and plainly outside.

    Parameters
    ----------
    function : the task function; the Prefect task is called as its output is in the store, or as the function
        where nothing of it is kept.
    """

    def __init__(self, function: Callable[P, R]) -> None:
        self.function = function
        update_wrapper(self, function)

    @property
    def name(self) -> str:
        """The one name of the stage: in the store, in Prefect, in messages and on the production page."""
        return str(getattr(self.function, "stage", getattr(self.function, "__name__", "stage")))

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the stage once."""
        try:
            if not flow_run_is_active():
                return self.function(*args, **kwargs)
            state = self._prefect_task(*args, **kwargs, return_state=True)
            result: R = state.result()
            return result
        except AerocalError as error:
            error.stage = error.stage or self.name
            raise

    def map(self, each: Sequence[Mapping[str, object]], *args: object, **common: object) -> tuple[R, ...]:
        """Run the stage once for each set of keyword arguments; the first expected error ends it.

        Parameters
        ----------
        each : the keyword arguments in which the runs differ; sets that are alike are run once.
        args, common : the arguments they share.

        Returns
        -------
        results : in the order of `each`, whichever run ends first.
        """
        outcomes = self.attempt([{**common, **one} for one in each], *args)
        results = tuple(outcome for outcome in outcomes if not isinstance(outcome, _EXPECTED))
        for outcome in outcomes:
            if isinstance(outcome, _EXPECTED):
                raise outcome
        return results

    def attempt(
        self,
        each: Sequence[Mapping[str, object]],
        *args: object,
        executor: Executor | None = None,
        when_done: Callable[[int, Attempt[R]], None] = lambda _index, _outcome: None,
    ) -> tuple[Attempt[R], ...]:
        """Run the stage for each set of keyword arguments; a run that fails does not stop the others.

        Parameters
        ----------
        each : the keyword arguments; sets that are alike are run once.
        args : the arguments they share.
        executor : where the runs are carried out side by side; None: here, one after the other.
        when_done : called with the index of a run in `each` and its outcome, as soon as it is known.

        Returns
        -------
        outcomes : in the order of `each`: results, and the errors of wrong input and of adjustments that
            cannot be computed. Any other error ends everything.
        """
        first_alike = [each.index(one) for one in each]
        outcomes: dict[int, Attempt[R]] = {}
        for first, outcome in self._outcomes({i: each[i] for i in first_alike}, args, executor):
            outcomes[first] = outcome
            if isinstance(outcome, _EXPECTED):
                outcome.stage = outcome.stage or self.name
            for index in (i for i, first_index in enumerate(first_alike) if first_index == first):
                when_done(index, outcome)
        return tuple(outcomes[first] for first in first_alike)

    def _outcomes(
        self, calls: Mapping[int, Mapping[str, object]], args: tuple[object, ...], executor: Executor | None
    ) -> Iterator[tuple[int, Attempt[R]]]:
        """Number and outcome of every call, as they are completed."""
        function: Any = self.function
        if flow_run_is_active():
            task = (
                self._prefect_task if executor is None else self._as_prefect_task(self._handed_to(executor))
            )
            submitted = {number: task.submit(*args, **call) for number, call in calls.items()}
            yield from ((number, _outcome(future.result)) for number, future in submitted.items())
        elif executor is None:
            yield from (
                (number, _outcome(partial(function, *args, **call))) for number, call in calls.items()
            )
        else:
            numbers: dict[Future[R], int] = {
                executor.submit(function, *args, **call): number for number, call in calls.items()
            }
            # Nothing holds on to what has been taken: a cluster would make it again if its worker died.
            yield from ((numbers.pop(done), _outcome(done.result)) for done in as_completed(numbers))

    def _handed_to(self, executor: Executor) -> Callable[P, R]:
        """The function, carried out by an executor while the caller waits."""

        @wraps(self.function)
        def hand_over(*args: P.args, **kwargs: P.kwargs) -> R:
            return executor.submit(self.function, *args, **kwargs).result()

        return hand_over

    @cached_property
    def _prefect_task(self) -> Any:
        """The Prefect task of the same function; made once, and only where Prefect is loaded already."""
        return self._as_prefect_task(self.function)

    def _as_prefect_task(self, function: Callable[P, R]) -> Any:
        """A Prefect task that carries the name of the stage."""
        prefect = sys.modules["prefect"]
        policies = sys.modules["prefect.cache_policies"]
        return prefect.task(
            _with_expected_errors_as_states(function),
            name=self.name,
            cache_policy=policies.NO_CACHE,
            persist_result=False,
            retries=1,
            retry_condition_fn=_a_retry_can_help,
        )


def _outcome(run: Callable[[], R]) -> Attempt[R]:
    """The result of a run, or the expected error it ended with."""
    try:
        return run()
    except _EXPECTED as error:
        return error


def _with_expected_errors_as_states(function: Callable[P, R]) -> Callable[P, Any]:
    """The function, ending in a failed state with one sentence if the user has to act.

    Prefect logs a traceback for an exception that leaves a task; one that comes as a failed state's
    data reaches the caller all the same, and the state says what it is.
    """

    @wraps(function)
    def body(*args: P.args, **kwargs: P.kwargs) -> Any:
        try:
            return function(*args, **kwargs)
        except AerocalError as error:
            states = sys.modules["prefect.states"]
            return states.Failed(name=state_name(error), message=str(error), data=error)

    return body


def stage(function: Callable[P, R]) -> Stage[P, R]:
    """Make a task function a stage of a story."""
    return Stage(function)


def _a_retry_can_help(_task: Any, _task_run: Any, state: Any) -> bool:
    """Whether a stage failed for a temporary reason: a lost connection, never an input or a result."""
    return isinstance(state.data, ConnectionError | TimeoutError)


def state_name(error: AerocalError) -> FailedState:
    """Name of the failed state an expected error ends in."""
    return next((name for kind, name in STATE_NAMES.items() if isinstance(error, kind)), "Failed")


def flow_run_is_active() -> bool:
    """Whether the caller is inside a Prefect flow run; False wherever Prefect is not even loaded."""
    context = sys.modules.get("prefect.context")
    return context is not None and context.FlowRunContext.get() is not None
