"""Exceptions. Their texts are those of the command line."""


class InsonifyError(Exception):
    """Base class of all exceptions of insonify."""


class InputError(InsonifyError, ValueError):
    """A value that the caller can correct."""


class MissingFileError(InputError, FileNotFoundError):
    """A file that does not exist."""


class StationError(InputError):
    """A station file or a setting that is not valid."""


class SceneError(InputError):
    """A scene that cannot be read or traced."""


class PoseError(InputError):
    """Numbers that are no pose."""


class DatasetError(InputError):
    """A data set that cannot be planned, made or read."""


class GeneratorError(InsonifyError, RuntimeError):
    """A model that is refused, or ONNX Runtime that is missing."""


class BackendError(InsonifyError, RuntimeError):
    """A graphics device that cannot be opened or has failed."""


class RenderError(InsonifyError, RuntimeError):
    """A frame that cannot be rendered."""


class InternalError(InsonifyError, RuntimeError):
    """An error inside insonify; please report it."""
