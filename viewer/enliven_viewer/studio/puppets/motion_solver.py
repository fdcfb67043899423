"""Solves the motions of puppets in the background. Until a solution is ready, the last valid motion is shown.

solving = MotionSolver(editor.toasts)
project, puppet = solving.get_newest_solution(project, "cactus")       # the newest with solved motions
state = evaluate_state(project, puppet, time)            # so this costs nothing
"""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from dataclasses import dataclass

from enliven.document import ExampleCharacter, Project, RigBase
from enliven.errors import EnlivenError
from enliven.examples.puppet_examples import find_missing_examples
from enliven.examples.puppet_motion import solve_layer_motion
from enliven_viewer.studio.toasts import Toasts

_MAX_WAIT_S = 0.012
"""Maximum time in seconds that a frame waits for a result. Faster results appear in the same frame."""


@dataclass(frozen=True, eq=False)
class _Request:
    """A request: a puppet and the project that holds its takes."""

    project: Project
    puppet: ExampleCharacter

    def matches(self, other: _Request | None) -> bool:
        """Returns True if another request is for the same motions, that is, the same puppet and takes."""
        if other is None or other.puppet is not self.puppet:
            return False
        names = {pose.take for pose in self.puppet.poses} | {layer.take for layer in self.puppet.layers}
        return all(self.project.takes[name] is other.project.takes[name] for name in names)


class _SolveState:
    """The state of solving for one puppet."""

    def __init__(self) -> None:
        self.solved: _Request | None = None
        self.requested: _Request | None = None
        self.future: Future[None] | None = None
        self.problem: EnlivenError | None = None
        self.reported_problem = ""


class MotionSolver:
    """A solver in a separate thread. It solves one puppet after another, and always uses the newest request.

    Args:
        toasts: shows errors, each once.
        patience: seconds that :meth:`newest_solution` waits for a motion.
    """

    def __init__(self, toasts: Toasts, patience: float = _MAX_WAIT_S) -> None:
        self.patience = patience
        self._toasts = toasts
        self._pool: ThreadPoolExecutor | None = None
        self._states: dict[str, _SolveState] = {}

    def find_shown(self, project: Project, character_id: str) -> tuple[Project, RigBase]:
        """Returns a character that can be shown now: a puppet with its newest solution, or any other
        character unchanged."""
        if character_id in project.puppets:
            return self.get_newest_solution(project, character_id)
        return project, project.character(character_id)

    def get_newest_solution(self, project: Project, puppet_id: str) -> tuple[Project, ExampleCharacter]:
        """Returns the newest solved project and puppet. If nothing has been solved yet, the puppet has no
        layers. The returned puppet may differ from the project's in its control points, so draw the returned
        puppet.
        """
        request = _Request(project, project.puppets[puppet_id])
        solved = self._states.setdefault(puppet_id, _SolveState())
        if request.matches(solved.solved) and solved.problem is None:
            assert solved.solved is not None
            return solved.solved.project, request.puppet
        if not request.puppet.layers or find_missing_examples(project, request.puppet):
            solved.solved = solved.problem = None
            return project, request.puppet.with_changes(
                layers=()
            ) if request.puppet.layers else request.puppet
        self._request_solution(solved, request)
        if solved.solved is None:
            return project, request.puppet.with_changes(layers=())
        return solved.solved.project, solved.solved.puppet

    def problem(self, puppet_id: str) -> EnlivenError | None:
        """Returns the error of solving a puppet's newest motions, or None if no error occurred."""
        solved = self._states.get(puppet_id)
        return solved.problem if solved else None

    def busy(self, puppet_id: str) -> bool:
        """Returns True if a motion of the puppet is being solved."""
        solved = self._states.get(puppet_id)
        return solved is not None and solved.future is not None

    def settle(self, project: Project, character_id: str) -> tuple[Project, RigBase]:
        """Returns the same as :meth:`find_shown`, but waits until the motion is solved or has failed.

        For sessions without a window.
        """
        shown = self.find_shown(project, character_id)
        while self.busy(character_id):
            future = self._states[character_id].future
            if future is not None:
                wait_for([future])
            shown = self.find_shown(project, character_id)
        return shown

    def close(self) -> None:
        """Ends the thread."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

    def _request_solution(self, solved: _SolveState, request: _Request) -> None:
        """Starts to solve a request unless it has failed before. Waits for the result for at most
        ``patience`` seconds.
        """
        if solved.future is None:
            if request.matches(solved.requested) and solved.problem is not None:
                return
            solved.requested, solved.future = request, self._begin(request)
            # Wait only once per request, because several panels request the result in the same frame.
            wait_for([solved.future], timeout=self.patience)
        if not solved.future.done():
            return
        error, requested = solved.future.exception(), solved.requested
        solved.future = None
        if error is None:
            solved.solved, solved.problem = requested, None
        else:
            self._store_error(solved, error)

    def _begin(self, request: _Request) -> Future[None]:
        if self._pool is None:
            self._pool = ThreadPoolExecutor(1, thread_name_prefix="solving")
        return self._pool.submit(_solve, request)

    def _store_error(self, solved: _SolveState, error: BaseException) -> None:
        """Stores the error, and reports it once."""
        if solved.reported_problem == str(error) and solved.problem is not None:
            return
        solved.reported_problem, solved.problem = str(error), self._toasts.show_any_error(error)


def _solve(request: _Request) -> None:
    """Solves the motion of every unmuted layer. The results are stored in the cache of
    :func:`enliven.examples.puppet_motion.solve_layer_motion`.
    """
    for number, layer in enumerate(request.puppet.layers):
        if not layer.muted and layer.weight > 0.0:
            solve_layer_motion(request.project, request.puppet, number)
