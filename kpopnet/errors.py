"""The one exception for what a user got wrong."""


class InputError(ValueError):
    """A file, an array or a setting is not what it has to be.

    The message says what was found and where (the file, the frame, the setting), what was expected, and what to do.
    """
