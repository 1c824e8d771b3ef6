"""What goes wrong because of what a user gave.

The command line prints a `ReconError` as one line and exits with status 2; every other exception is a bug and keeps
its traceback.
"""


class ReconError(Exception):
    """Root of all errors that a user can mend; its text names the file, the value and what was expected."""


class InputError(ReconError):
    """An input file or folder is missing, damaged or says something that cannot be."""


class OutputError(ReconError):
    """An output cannot be written, or its suffix is unknown."""


class ConfigError(ReconError):
    """A configuration file or option names an unknown key or a value out of range."""


class MissingLibraryError(ReconError):
    """A system library that a dependency needs is not installed."""
