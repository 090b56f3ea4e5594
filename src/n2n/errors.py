"""Errors a user can act on: each message says what was got, what was expected and how to fix it, in one line."""


class N2NError(Exception):
    """Base of all errors that n2n raises on purpose; the command line prints the message and no traceback."""


class InputError(N2NError):
    """A file or point cloud cannot be used as it is."""


class ConfigError(N2NError):
    """A configuration key, component name or value is unknown or out of range."""


class SurfaceError(N2NError):
    """The fitted field has no usable level set at the requested iso-value."""


class OutputError(N2NError):
    """A result cannot be written where it was asked for."""
