"""The few errors that indicial raises on purpose; all derive from `IndicialError`."""


class IndicialError(Exception):
    """Base of every error that indicial raises on purpose. Its text is one line for a user."""


class InputError(IndicialError, ValueError):
    """Something a user gave is wrong: the message names it and says what is allowed."""


class DivergenceError(IndicialError, RuntimeError):
    """A solver failed: the message says where, when and what to try.

    Parameters
    ----------
    message : str
    cell : int, optional
        The mesh cell in which it is worst.
    time : float, optional
        When, in the solver's units.
    state : optional
        The last good flow state, for whoever can keep it.
    """

    def __init__(self, message: str, *, cell: int | None = None, time: float = 0.0, state: object = None) -> None:
        super().__init__(message)
        self.cell = cell
        self.time = time
        self.state = state


class NoLimitError(IndicialError, ValueError):
    """A derivative was asked for that has no limit; the message says why."""
