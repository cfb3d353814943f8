"""The few errors that indicial raises on purpose; all derive from `IndicialError`."""


class IndicialError(Exception):
    """Base of every error that indicial raises on purpose. Its text is one line for a user."""


class InputError(IndicialError, ValueError):
    """Something a user gave is wrong: the message names it and says what is allowed."""


class DivergenceError(IndicialError, RuntimeError):
    """A solver failed: the message says where, when and what to try."""


class NoLimitError(IndicialError, ValueError):
    """A derivative was asked for that has no limit; the message says why."""
