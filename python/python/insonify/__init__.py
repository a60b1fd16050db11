"""insonify: a real-time ultrasound simulator. The pose of a probe becomes B-mode frames with maps.

>>> import insonify
>>> station = insonify.Station("sphere")
>>> frame = station.render(quality="fast")
>>> frame.bmode.shape == frame.segmentation.shape
True

Lengths are in mm, times in seconds, and the unit is in the name. Warnings go to the logger `insonify`.
"""

from ._data import data_directory, model_names, station_names
from ._dataset import Dataset, Made, Tuple, make_dataset
from ._errors import (
    BackendError,
    DatasetError,
    GeneratorError,
    InputError,
    InsonifyError,
    InternalError,
    MissingFileError,
    PoseError,
    RenderError,
    SceneError,
    StationError,
)
from ._exercise import (
    Ball,
    Deduction,
    Exercise,
    ExercisePlan,
    Moment,
    NeedleEvent,
    NeedleSample,
    NeedleScore,
    NeedleSession,
    NeedleStep,
)
from ._frame import Frame
from ._generator import Generator
from ._insonify import __version__
from ._needle import Needle
from ._plan import Decision, EffectPlan
from ._planes import Offset, StandardPlane, StandardPlanes, Tolerances, Touch, View
from ._pose import Pose, PoseLike
from ._scene import MeshLike, Scene, Surface, SurfaceLike
from ._settings import Key, station_keys, tissues
from ._station import Job, Quality, Station

__all__ = [
    "BackendError",
    "Ball",
    "Dataset",
    "DatasetError",
    "Decision",
    "Deduction",
    "EffectPlan",
    "Exercise",
    "ExercisePlan",
    "Frame",
    "Generator",
    "GeneratorError",
    "InputError",
    "InsonifyError",
    "InternalError",
    "Job",
    "Key",
    "Made",
    "MeshLike",
    "MissingFileError",
    "Moment",
    "Needle",
    "NeedleEvent",
    "NeedleSample",
    "NeedleScore",
    "NeedleSession",
    "NeedleStep",
    "Offset",
    "Pose",
    "PoseError",
    "PoseLike",
    "Quality",
    "RenderError",
    "Scene",
    "SceneError",
    "StandardPlane",
    "StandardPlanes",
    "Station",
    "StationError",
    "Surface",
    "SurfaceLike",
    "Tolerances",
    "Touch",
    "Tuple",
    "View",
    "__version__",
    "data_directory",
    "make_dataset",
    "model_names",
    "station_keys",
    "station_names",
    "tissues",
]
